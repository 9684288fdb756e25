//! What a campaign declares of a sensor.

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
