//! Errors of assembling a map.

use mapper_core::{Method, step_number, with_unit};

/// Why a map cannot be assembled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AssembleError {
    /// There are no points.
    #[error("there are no points to make a map of; identify at least one step first")]
    NoPoints,
    /// A coordinate of a point is not finite.
    #[error(
        "step {}: {quantity} is {}, so the point has no place on the map; exclude the step, or correct the channel",
        step_number(*step),
        with_unit(value, unit)
    )]
    NotFinite {
        /// Index of the step, from 0.
        step: usize,
        /// Name of the coordinate.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// A point was identified by a method other than the map's.
    #[error(
        "step {} was identified by `{found}`, the map is `{expected}`; identify all points by one method",
        step_number(*step)
    )]
    MixedMethods {
        /// Index of the step, from 0.
        step: usize,
        /// Method of the map.
        expected: Method,
        /// Method of the point.
        found: Method,
    },
}
