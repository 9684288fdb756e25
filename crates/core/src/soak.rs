//! The machine at rest before a run.

use crate::Channel;
use serde::{Deserialize, Serialize};

/// How the machine rests before it runs, so that sensors which must read the same can be held against each other: the
/// isothermal zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Soak {
    /// Time at rest, s, > 0.
    pub duration_s: f64,
    /// Oil inlet temperature in the meantime, K: that of cell and inlet air.
    pub oil_temperature_k: f64,
    /// How even the soak is: one standard deviation of what a temperature sensor truly sees about what all see, K, >= 0.
    pub temperature_sigma_k: f64,
    /// The same of the pressure taps, Pa, >= 0.
    pub pressure_sigma_pa: f64,
}

impl Soak {
    /// Sensors that read alike at rest: temperatures, and pressures.
    pub const ALIKE: [&'static [Channel]; 2] =
        [&[Channel::T1, Channel::T2, Channel::Tc, Channel::TOil], &[Channel::P1, Channel::P2]];
    /// How even a soak is if nothing is declared: 0.05 K.
    pub const TEMPERATURE_SIGMA_K: f64 = 0.05;
    /// The same of the pressures: 5 Pa.
    pub const PRESSURE_SIGMA_PA: f64 = 5.0;
}
