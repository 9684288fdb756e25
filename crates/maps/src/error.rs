//! Why points make no map.

use mapper_core::{Method, step_number, with_unit};

/// Why points make no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AssembleError {
    /// There is nothing to assemble.
    #[error("there are no points to make a map of; identify at least one step first")]
    NoPoints,
    /// A coordinate of a point is not a number, so that it has no place on the map.
    #[error(
        "step {}: {quantity} is {}, so the point has no place on the map; leave the step out or repair the channel",
        step_number(*step),
        with_unit(value, unit)
    )]
    NoPlace {
        /// Place of the step, from 0.
        step: usize,
        /// Which coordinate.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// A point was identified by another method than the map says.
    #[error(
        "step {} was identified by `{found}`, the map is `{expected}`; identify all points by one method",
        step_number(*step)
    )]
    MixedMethods {
        /// Place of the step, from 0.
        step: usize,
        /// Method of the map.
        expected: Method,
        /// Method of the point.
        found: Method,
    },
    /// The gap between speed lines is not a usable number.
    #[error("the speed gap is {speed_gap_ratio}; it must be above 0 and below 1, e.g. 0.04")]
    SpeedGap {
        /// What was given.
        speed_gap_ratio: f64,
    },
}
