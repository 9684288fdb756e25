//! Errors of assembling a map.

use mapper_core::{Method, step_number, with_unit};

/// Why a map cannot be assembled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum AssembleError {
    #[error("there are no points to make a map of; identify at least one step first")]
    NoPoints,
    #[error(
        "step {}: {quantity} is {}, so the point has no place on the map; exclude the step, or correct the channel",
        step_number(*step),
        with_unit(value, unit)
    )]
    NotFinite { step: usize, quantity: &'static str, value: f64, unit: &'static str },
    #[error(
        "step {} was identified by `{found}`, the map is `{expected}`; identify all points by one method",
        step_number(*step)
    )]
    MixedMethods { step: usize, expected: Method, found: Method },
}
