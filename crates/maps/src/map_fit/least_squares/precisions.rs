//! Variance components of a fit, as precisions.

use crate::map_fit::speed_lines::line_shape::Parameters;

/// Standard errors beyond which a residual loses weight. Bound: by chance exceeded once in 370 times.
pub(crate) const ROBUST_SIGMAS: f64 = 3.0;

/// Range of the precision of a roughness over its starting value. Bound: twenty times stiffer is visually straight; a stiffer one would
/// make errors beyond the measured lines too small.
pub(crate) const ROUGHNESS_PRECISION_RANGE: [f64; 2] = [0.03, 20.0];

/// Variance components.
pub(crate) struct Precisions {
    /// Precision of the roughness of each parameter over speed.
    pub(crate) rough: Parameters,
    /// Precision of each line offset.
    pub(crate) lines: [f64; 3],
    /// Scales of the residuals of distance and efficiency.
    pub(crate) scales: [f64; 2],
}
