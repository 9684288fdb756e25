//! `gas:`

use crate::checking::Check;
use crate::units::{Fraction, Kind, Quantity};
use mapper_physics::gas::mixture::{Fuel, Gas, Species};
use mapper_physics::machine::params::Params;
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::Deserialize;

/// Difference of the sum of volume fractions from 1 that rounding explains, ratio: six values rounded to tenths of a per cent.
const MAX_ROUNDING_RATIO: f64 = 0.003;

/// The gases that flow through the machine.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GasFile {
    /// Dry gas of the compressor: `air` as a real gas, `closed_form_air`, whose heat capacity is a formula (the default, and the gas of the virtual lab's reference solutions), or volume fractions of a mixture, whose viscosity and conductivity stay those of air. `report: {humidity: 50 %}` adds water vapour.
    #[schemars(example = &"air")]
    compressor: Option<CompressorGas>,
    /// Gas of the turbine: combustion products of a fuel in air. `closed_form_air` if it is omitted.
    turbine: Option<BurntGas>,
}

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum CompressorGas {
    Named(NamedGas),
    Mixture(Composition),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedGas {
    Air,
    ClosedFormAir,
}

/// Volume fractions of a dry gas; their sum is 100 %.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Composition {
    /// Nitrogen.
    #[serde(rename = "N2")]
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"77 %")]
    nitrogen: Option<Quantity<Fraction>>,
    /// Oxygen.
    #[serde(rename = "O2")]
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"20 %")]
    oxygen: Option<Quantity<Fraction>>,
    /// Argon.
    #[serde(rename = "Ar")]
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"1 %")]
    argon: Option<Quantity<Fraction>>,
    /// Carbon dioxide.
    #[serde(rename = "CO2")]
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"0 %")]
    carbon_dioxide: Option<Quantity<Fraction>>,
    /// Hydrogen.
    #[serde(rename = "H2")]
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"2 %")]
    hydrogen: Option<Quantity<Fraction>>,
    /// Methane.
    #[serde(rename = "CH4")]
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"0 %")]
    methane: Option<Quantity<Fraction>>,
}

/// Dry air burnt completely with a fuel.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BurntGas {
    /// The fuel.
    #[schemars(example = &"diesel")]
    fuel: FuelName,
    /// Actual over stoichiometric amount of air, a plain number.
    #[schemars(range(min = 1, max = 100), example = 3)]
    air_ratio: f64,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FuelName {
    /// Diesel or kerosene: 1.80 hydrogen atoms per carbon atom.
    Diesel,
    /// 3.78 hydrogen atoms per carbon atom.
    NaturalGas,
    Hydrogen,
}

impl GasFile {
    /// Sets the gases of a machine.
    pub(crate) fn apply(&self, params: &mut Params) {
        if let Some(gas) = self.compressor {
            params.compressor.gas = gas.into();
        }
        if let Some(BurntGas { fuel, air_ratio }) = self.turbine {
            let fuel = match fuel {
                FuelName::Diesel => Fuel::DIESEL,
                FuelName::NaturalGas => Fuel::NATURAL_GAS,
                FuelName::Hydrogen => Fuel::HYDROGEN,
            };
            params.turbine.gas = Gas::burnt(fuel, air_ratio);
        }
    }
}

impl From<CompressorGas> for Gas {
    fn from(gas: CompressorGas) -> Gas {
        match gas {
            CompressorGas::Named(NamedGas::Air) => Gas::air(),
            CompressorGas::Named(NamedGas::ClosedFormAir) => Gas::CLOSED_FORM_AIR,
            CompressorGas::Mixture(Composition {
                nitrogen,
                oxygen,
                argon,
                carbon_dioxide,
                hydrogen,
                methane,
            }) => {
                let fractions = [
                    (Species::N2, nitrogen),
                    (Species::O2, oxygen),
                    (Species::Ar, argon),
                    (Species::CO2, carbon_dioxide),
                    (Species::H2, hydrogen),
                    (Species::CH4, methane),
                ];
                let given = fractions.into_iter().filter_map(|(species, x)| Some((species, x?.value)));
                Gas::of_mole_fractions(given)
            }
        }
    }
}

/// Checks that the fractions of a mixture add up.
pub(crate) fn check(check: &mut Check<'_>) {
    let at = steps!["gas", "compressor"];
    let tree = check.tree;
    let fractions: Vec<f64> = tree
        .keys(&at)
        .filter_map(|species| check.quantity(Kind::Fraction, &steps!["gas", "compressor", species]))
        .map(|(fraction, _)| fraction)
        .collect();
    let sum: f64 = fractions.iter().sum();
    if !fractions.is_empty() && (sum - 1.0).abs() > MAX_ROUNDING_RATIO {
        check.note(
            FindingKind::Conflict,
            &at,
            format!("the volume fractions add up to {:.2} %, not to 100 %", 100.0 * sum),
            "give every species of the dry gas; `report: {humidity: ...}` adds its water",
        );
    }
}
