//! Variations within which an operating point counts as settled.

use serde::{Deserialize, Serialize};

/// Maximum variation (maximum minus minimum) of each quantity, as a ratio of its mean: an operating point has settled at a time if the
/// variation from then to the end of the step is within these bands. The criterion is implemented only in the
/// `settled` module of `mapper-physics`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SettleBands {
    /// Shaft speed, ratio.
    pub speed_ratio: f64,
    /// Compressor flow, ratio.
    pub flow_ratio: f64,
    /// Pressure ratio, ratio.
    pub pressure_ratio_ratio: f64,
}

impl Default for SettleBands {
    /// The typical variations in section 3 of Burke et al.: 0.8 % in speed, 1.5 % in flow, 2 % in pressure ratio.
    fn default() -> Self {
        SettleBands { speed_ratio: 0.008, flow_ratio: 0.015, pressure_ratio_ratio: 0.02 }
    }
}
