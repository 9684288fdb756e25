//! Relative weights of the parts of a fit.

use crate::map_fit::speed_lines::line_shape::Parameters;

/// Standard errors beyond which a residual loses weight.
pub(crate) const ROBUST: f64 = 3.0;

/// Least and most of a roughness' precision, over where its estimation starts. Twenty times stiffer is a straight line to the
/// eye; more would only make errors too sure beyond the measured lines.
pub(crate) const ROUGHNESS_REACH: [f64; 2] = [0.03, 20.0];

/// Variance components, as precisions.
pub(crate) struct Precisions {
    pub(crate) rough: Parameters,
    pub(crate) lines: [f64; 3],
    /// Scales of distance and efficiency.
    pub(crate) scales: [f64; 2],
}
