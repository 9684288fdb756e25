//! `zero:`

use crate::si::or;
use crate::units::{Duration, Quantity, Temperature};
use mapper_core::Soak;
use schemars::JsonSchema;
use serde::Deserialize;

/// The isothermal zero: the run begins with the machine at rest, and the identification takes off what T1, T2, Tc and T_oil, and P1 and P2, then differ by.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ZeroFile {
    /// Time at rest before the warm-up, air off: until oil and housing have the temperature of the cell. Its last ten minutes are used, and refused where a temperature still drifts by more than 0.1 K/min.
    #[schemars(extend("x-min" = "1 min", "x-max" = "24 h"), example = &"30 min")]
    soak: Quantity<Duration>,
    /// Oil inlet temperature in the meantime; that of the inlet air if none is given.
    #[schemars(extend("x-min" = "250 K", "x-max" = "450 K"), example = &"25 degC")]
    oil_temperature: Option<Quantity<Temperature>>,
}

impl ZeroFile {
    /// The soak, with the inlet air's temperature where the oil has none of its own, K.
    pub(crate) fn soak(self, inlet_temperature_k: f64) -> Soak {
        Soak {
            duration_s: self.soak.inside,
            oil_temperature_k: or(self.oil_temperature, inlet_temperature_k),
        }
    }
}
