//! The isothermal zero as it is written.

use crate::units::{Duration, Quantity, Temperature};
use schemars::JsonSchema;
use serde::Deserialize;

/// The isothermal zero: the run begins with the machine at rest, and the identification takes off what T1, T2, Tc and T_oil, and P1 and P2, then differ by.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ZeroFile {
    /// Time at rest before the warm-up, air off: until oil and housing have the temperature of the cell. Its last ten minutes are used, and refused where a temperature still drifts by more than 0.1 K/min.
    #[schemars(extend("x-min" = "1 min", "x-max" = "24 h"), example = &"30 min")]
    pub soak: Quantity<Duration>,
    /// Oil inlet temperature in the meantime; that of the inlet air where none is given.
    #[schemars(extend("x-min" = "250 K", "x-max" = "450 K"), example = &"25 degC")]
    pub oil_temperature: Option<Quantity<Temperature>>,
}
