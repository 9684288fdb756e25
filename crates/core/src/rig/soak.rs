//! The soak before a run.

use crate::Channel;
use serde::{Deserialize, Serialize};

/// Soaks the machine before the run until sensors see one temperature and one pressure, so that their offsets can be zeroed:
/// the isothermal zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Soak {
    /// Time at rest, s, > 0.
    pub duration_s: f64,
    /// Oil inlet temperature during the soak, K: equal to that of cell and inlet air.
    pub oil_temperature_k: f64,
    /// Temperature non-uniformity: standard deviation of the true temperature at a sensor about the mean of all, K, >= 0.
    pub temperature_sigma_k: f64,
    /// Standard deviation of the pressure taps at rest, Pa, >= 0.
    pub pressure_sigma_pa: f64,
}

impl Soak {
    /// Groups of sensors that must read the same at standstill: temperatures and pressures.
    pub const EQUAL_AT_REST: [&'static [Channel]; 2] =
        [&[Channel::T1, Channel::T2, Channel::Tc, Channel::TOil], &[Channel::P1, Channel::P2]];
    /// Default temperature non-uniformity of a soak: 0.05 K.
    pub const TEMPERATURE_SIGMA_K: f64 = 0.05;
    /// Default of [`Soak::pressure_sigma_pa`]: 5 Pa.
    pub const PRESSURE_SIGMA_PA: f64 = 5.0;
}
