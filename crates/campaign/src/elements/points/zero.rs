//! `zero:`

use crate::si_values::value_or;
use crate::units::{Duration, PressureDifference, Quantity, Temperature, TemperatureDifference};
use mapper_core::Soak;
use schemars::JsonSchema;
use serde::Deserialize;

/// The isothermal zero: the run begins with a soak, in which T1, T2, Tc and T_oil have one temperature, and P1 and P2 one pressure; the identification subtracts their differences.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ZeroFile {
    /// Time at rest before the warm-up, air off: until oil and housing have the temperature of the cell. The zero uses its last ten minutes, and is refused if a temperature still drifts by more than 0.1 K/min.
    #[schemars(extend("x-min" = "1 min", "x-max" = "24 h"), example = &"30 min")]
    soak: Quantity<Duration>,
    /// Oil inlet temperature during the soak; that of the inlet air if none is given.
    #[schemars(extend("x-min" = "250 K", "x-max" = "450 K"), example = &"25 degC")]
    oil_temperature: Option<Quantity<Temperature>>,
    /// Temperature non-uniformity of the rig at rest, one standard deviation of the temperature at a sensor about the mean of all sensors: the uncertainty of each offset after the zero; 0.05 K if none is given.
    #[schemars(extend("x-min" = "0 K", "x-max" = "1 K"), example = &"0.05 K")]
    evenness: Option<Quantity<TemperatureDifference>>,
    /// Uncertainty of the pressure at P1 and P2 at rest, one standard deviation; 5 Pa if none is given.
    #[schemars(extend("x-min" = "0 Pa", "x-max" = "1 kPa"), example = &"5 Pa")]
    pressure_evenness: Option<Quantity<PressureDifference>>,
}

impl ZeroFile {
    /// The soak, with the inlet air's temperature if none is given for the oil, K.
    pub(crate) fn soak(self, inlet_temperature_k: f64) -> Soak {
        Soak {
            duration_s: self.soak.value,
            oil_temperature_k: value_or(self.oil_temperature, inlet_temperature_k),
            temperature_sigma_k: value_or(self.evenness, Soak::TEMPERATURE_SIGMA_K),
            pressure_sigma_pa: value_or(self.pressure_evenness, Soak::PRESSURE_SIGMA_PA),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<ZeroFile>(text).unwrap().soak(298.15);
        let plain = Soak {
            duration_s: 1800.0,
            oil_temperature_k: 298.15,
            temperature_sigma_k: 0.05,
            pressure_sigma_pa: 5.0,
        };
        assert_eq!(read("{soak: 30 min}"), plain);
        let written = Soak { temperature_sigma_k: 0.15, pressure_sigma_pa: 15.0, ..plain };
        assert_eq!(read("{soak: 0.5 h, evenness: 0.15 K, pressure_evenness: 15 Pa}"), written);
    }
}
