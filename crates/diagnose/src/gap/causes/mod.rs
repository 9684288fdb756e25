//! Selection of the effects that explain the gap, their probabilities, detection limits, and location in the machine.

pub mod additions;
pub mod calibration;
pub(crate) mod place;
pub mod probabilities;
pub(crate) mod select;
pub(crate) mod smallest_seen;
