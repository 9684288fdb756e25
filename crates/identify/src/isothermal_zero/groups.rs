//! Sensors that must read the same at standstill, and the criteria by which a standstill is a soak.

use mapper_core::{Channel, Soak};
use serde::{Deserialize, Serialize};

/// Longest segment at the end of a soak that is used, s. Bound: on average over it, noise of 0.1 K is below 0.01 K.
const LONGEST_SOAK_S: f64 = 600.0;
/// Minimum length of that segment, s. Bound: noise of 0.1 K at 10 Hz leaves its drift an error of 0.02 K/min.
pub(super) const SHORTEST_SOAK_S: f64 = 60.0;

/// Residual non-uniformity of a soak, and the criteria by which a soak is recognised.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ZeroSettings {
    /// Residual temperature non-uniformity (one standard deviation of a sensor from the mean), K, > 0.
    pub temperature_sigma_k: f64,
    /// Residual pressure non-uniformity, one standard deviation, Pa, > 0.
    pub pressure_sigma_pa: f64,
    /// Longest segment before the first step that is used, s: the last one of the standstill.
    pub longest_s: f64,
    /// Minimum length of the segment, s.
    pub shortest_s: f64,
    /// Maximum drift of a temperature over the segment, K/min; a faster drift means an unfinished soak.
    pub drift_k_min: f64,
    /// Whether one temperature sensor may exceed its declared offset.
    pub allows_a_fault: bool,
}

impl Default for ZeroSettings {
    /// Default non-uniformity; accepts the last minute to ten minutes if they drift by less than 0.1 K/min.
    fn default() -> Self {
        ZeroSettings {
            temperature_sigma_k: Soak::TEMPERATURE_SIGMA_K,
            pressure_sigma_pa: Soak::PRESSURE_SIGMA_PA,
            longest_s: LONGEST_SOAK_S,
            shortest_s: SHORTEST_SOAK_S,
            drift_k_min: Soak::MAX_DRIFT_K_MIN,
            allows_a_fault: false,
        }
    }
}

impl From<Soak> for ZeroSettings {
    /// With the declared non-uniformity.
    fn from(soak: Soak) -> Self {
        ZeroSettings {
            temperature_sigma_k: soak.temperature_sigma_k,
            pressure_sigma_pa: soak.pressure_sigma_pa,
            ..ZeroSettings::default()
        }
    }
}

/// Sensors of the turbine's gas and housing: they may stay warm when the others rest, and never refuse a zero.
pub(super) const HOT_SIDE: [Channel; 3] = [Channel::T3, Channel::T4, Channel::Tt];
/// Sensors of housings, whose readings are extrapolated to their limits.
pub(super) const HOUSINGS: [Channel; 2] = [Channel::Tc, Channel::Tt];
/// Number of channels at the head of a group without which it is not zeroed. Bound: one sensor has nothing to be compared with.
pub(super) const CORE: usize = 2;

/// Sensors that read the same at standstill.
pub(super) struct Group {
    pub(super) channels: &'static [Channel],
    /// Residual non-uniformity, K or Pa.
    pub(super) sigma: f64,
    /// Maximum drift, per minute; `None` for pressures, which follow the weather together.
    pub(super) drift_limit_per_min: Option<f64>,
    /// Whether the cell has an instrument for the same quantity.
    pub(super) has_reference: bool,
}

impl Group {
    /// Whether the group is not zeroed without this channel.
    pub(super) fn is_core(&self, channel: Channel) -> bool {
        self.channels.iter().take(CORE).any(|core| *core == channel)
    }
}

pub(super) fn groups(settings: &ZeroSettings) -> [Group; 3] {
    let [temperatures, pressures, turbine_pressures] = Soak::EQUAL_AT_REST;
    let of_pressures = |channels, has_reference| Group {
        channels,
        sigma: settings.pressure_sigma_pa,
        drift_limit_per_min: None,
        has_reference,
    };
    let temperatures = Group {
        channels: temperatures,
        sigma: settings.temperature_sigma_k,
        drift_limit_per_min: Some(settings.drift_k_min),
        has_reference: true,
    };
    [temperatures, of_pressures(pressures, true), of_pressures(turbine_pressures, false)]
}
