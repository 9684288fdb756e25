//! Declared uncertainty of a sensor.

use serde::{Deserialize, Serialize};

/// One-sigma uncertainty of a channel, in its SI unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeclaredUncertainty {
    /// Noise of one sample.
    pub noise_sigma: f64,
    /// Fixed offset.
    pub offset_sigma: f64,
    /// Fixed gain error, ratio to the value.
    pub gain_sigma_ratio: f64,
}

/// Sensor noise as a white and a first-order part in quadrature: shares `sqrt(1 - c^2)` and `c`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseColour {
    /// Share c of the first-order part in the standard deviation, 0..1.
    pub first_order_share_ratio: f64,
    /// Its time constant, s, > 0.
    pub time_constant_s: f64,
}

impl Default for NoiseColour {
    fn default() -> Self {
        NoiseColour { first_order_share_ratio: 0.6, time_constant_s: 2.0 }
    }
}
