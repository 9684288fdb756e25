//! `identification.stabilisation:`

use crate::si_values::si;
use crate::units::{Fraction, Quantity};
use mapper_core::SettleBands;
use schemars::JsonSchema;
use serde::Deserialize;

/// Variations over the window within which a point counts as settled.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(remote = "SettleBands", default, deny_unknown_fields)]
pub(crate) struct SettleBandsElement {
    /// Shaft speed; 0.8 % if none is given.
    #[serde(rename = "speed", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-above" = "0 %", "x-max" = "100 %"), example = &"0.8 %")]
    speed_ratio: f64,
    /// Compressor flow; 1.5 % if none is given.
    #[serde(rename = "flow", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-above" = "0 %", "x-max" = "100 %"), example = &"1.5 %")]
    flow_ratio: f64,
    /// Pressure ratio; 2 % if none is given.
    #[serde(rename = "pressure_ratio", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-above" = "0 %", "x-max" = "100 %"), example = &"2 %")]
    pressure_ratio_ratio: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::any_with;

    #[test]
    fn what_is_left_out_keeps_its_default() {
        let read = |text| any_with(text, SettleBandsElement::deserialize);
        let default = SettleBands::default();
        assert_eq!(read("{}").unwrap(), default);
        assert_eq!(read("{flow: 3 %}").unwrap(), SettleBands { flow_ratio: 0.03, ..default });
        assert!(read("{flow: 3}").is_err() && read("{fow: 3 %}").is_err());
    }
}
