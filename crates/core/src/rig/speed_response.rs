//! Response of the shaft speed to the turbine inlet pressure around one point, and its use to control the speed.

use serde::{Deserialize, Serialize};

/// The nominal machine around a steady state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedResponse {
    /// Change of the steady shaft speed with P3, rpm/Pa, > 0.
    pub rpm_per_pa: f64,
    /// Relative change of P3 per relative change of the turbine's power, ratio, > 0.
    pub p3_per_power: f64,
    /// Time constant with which the speed follows P3's command, actuator included, s, > 0.
    pub time_constant_s: f64,
}

/// The closed loop over the shaft speed, as declared in the campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedControlSettings {
    /// Deviation from the target within which the speed counts as reached, ratio, > 0.
    pub band_ratio: f64,
}

impl SpeedControlSettings {
    /// Default band, ratio.
    pub const BAND_RATIO: f64 = 0.003;
}

impl Default for SpeedControlSettings {
    fn default() -> Self {
        SpeedControlSettings { band_ratio: SpeedControlSettings::BAND_RATIO }
    }
}
