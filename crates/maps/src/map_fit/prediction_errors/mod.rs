//! Prediction errors of a map fit: deviations at points, omitted lines, and extrapolation beyond the measured speeds.

pub(crate) mod beyond;
pub(crate) mod leave_out;
pub(crate) mod miss;
