//! Shape of the speed lines in a map fit, its variation over speed, and the checks for crossing lines.

pub(crate) mod line_shape;
pub(crate) mod speed_spline;
