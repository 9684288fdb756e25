//! Selection of the effects that explain the gap, their probabilities, detection limits, and location in the machine.

pub mod additions;
pub mod calibration;
pub mod place;
pub mod select;
pub mod smallest_seen;
pub mod weigh;
