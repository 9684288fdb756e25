//! Declared uncertainty of a sensor.

use serde::{Deserialize, Serialize};

/// Sample interval of the program's own recordings, to which declared noise refers, s.
pub const SAMPLE_INTERVAL_S: f64 = 0.1;

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

/// Colour of the sensor noise: white noise and first-order noise, with standard deviations `sqrt(1 - c^2)` and `c` of the total.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseColour {
    /// Share c of the first-order noise in the standard deviation, 0..1.
    pub first_order_share_ratio: f64,
    /// Time constant, s, > 0.
    pub time_constant_s: f64,
}

impl Default for NoiseColour {
    fn default() -> Self {
        NoiseColour { first_order_share_ratio: 0.6, time_constant_s: 2.0 }
    }
}
