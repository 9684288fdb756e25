//! `reference:`, the reference state of a map file, and `efficiency:`.

use crate::units::{Pressure, Quantity, Temperature};
use mapper_core::{EfficiencyDefinition, ReferenceState};
use schemars::JsonSchema;
use serde::Deserialize;

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum ReferenceFile {
    Named(NamedReference),
    State(StateFile),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
pub(crate) enum NamedReference {
    #[serde(rename = "SAE")]
    Sae,
    Garrett,
    BorgWarner,
}

/// A reference state.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StateFile {
    /// Reference temperature.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"), example = &"298 K")]
    temperature: Quantity<Temperature>,
    /// Reference pressure.
    #[schemars(extend("x-min" = "50 kPa", "x-max" = "200 kPa"))]
    pressure: Quantity<Pressure>,
}

impl From<ReferenceFile> for ReferenceState {
    fn from(file: ReferenceFile) -> Self {
        match file {
            ReferenceFile::Named(NamedReference::Sae) => ReferenceState::SAE,
            ReferenceFile::Named(NamedReference::Garrett) => ReferenceState::GARRETT,
            ReferenceFile::Named(NamedReference::BorgWarner) => ReferenceState::BORGWARNER,
            ReferenceFile::State(state) => {
                ReferenceState { t_ref_k: state.temperature.value, p_ref_pa: state.pressure.value }
            }
        }
    }
}

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum EfficiencyFile {
    Named(NamedEfficiency),
    Gamma(GammaFile),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
pub(crate) enum NamedEfficiency {
    #[serde(rename = "enthalpy")]
    Enthalpy,
    #[serde(rename = "kappa_of_T1")]
    KappaOfT1,
}

/// Efficiency by temperature rises at a constant ratio of heat capacities.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GammaFile {
    /// Ratio of heat capacities, e.g. 1.4 for air.
    // Kinetic theory: 5/3 for a monatomic gas, less for all others.
    #[schemars(range(max = 1.667), extend("exclusiveMinimum" = 1), example = 1.4)]
    constant_gamma: f64,
}

impl From<EfficiencyFile> for EfficiencyDefinition {
    fn from(file: EfficiencyFile) -> Self {
        match file {
            EfficiencyFile::Named(NamedEfficiency::Enthalpy) => EfficiencyDefinition::Enthalpy,
            EfficiencyFile::Named(NamedEfficiency::KappaOfT1) => EfficiencyDefinition::KappaOfT1,
            EfficiencyFile::Gamma(file) => EfficiencyDefinition::ConstantGamma(file.constant_gamma),
        }
    }
}
