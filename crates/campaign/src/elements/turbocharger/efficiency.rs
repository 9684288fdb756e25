//! `efficiency:`

use mapper_core::EfficiencyDefinition;
use schemars::JsonSchema;
use serde::Deserialize;

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
