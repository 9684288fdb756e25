//! Relative weights of the parts of a fit.

use super::line_shape::Parameters;

/// Standard errors beyond which a residual loses weight.
pub(super) const ROBUST: f64 = 3.0;

/// Least and most of a roughness' precision, over where its estimation starts. Twenty times stiffer is a straight line to the
/// eye; more would only make errors too sure beyond the measured lines.
pub(super) const ROUGHNESS_REACH: [f64; 2] = [0.03, 20.0];

/// Variance components, as precisions.
pub(super) struct Precisions {
    pub(super) rough: Parameters,
    pub(super) lines: [f64; 3],
    /// Scales of distance and efficiency.
    pub(super) scales: [f64; 2],
}
