//! Prediction errors of a map fit: deviations at points, left-out lines, and extrapolation beyond the measured speeds.

pub(crate) mod deviation;
pub(crate) mod extrapolation;
pub(crate) mod leave_out;
