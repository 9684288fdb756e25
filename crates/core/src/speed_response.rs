//! How the shaft speed answers to the turbine inlet pressure around one point, and how a run holds the speed with it.

use serde::{Deserialize, Serialize};

/// The nominal machine around a point at which it rests.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedResponse {
    /// Change of the resting shaft speed with P3, rpm/Pa, > 0.
    pub rpm_per_pa: f64,
    /// Relative change of P3 that makes a relative change of the turbine's power, ratio, > 0.
    pub p3_per_power: f64,
    /// Time constant with which the speed follows P3's command, actuator included, s, > 0.
    pub time_constant_s: f64,
}

/// The closed loop over the shaft speed: what the campaign says of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedControlSettings {
    /// Within this share of its target the speed counts as reached, ratio, > 0.
    pub band_ratio: f64,
}

impl SpeedControlSettings {
    /// Band where a campaign says nothing, ratio.
    pub const BAND_RATIO: f64 = 0.003;
}

impl Default for SpeedControlSettings {
    fn default() -> Self {
        SpeedControlSettings { band_ratio: SpeedControlSettings::BAND_RATIO }
    }
}
