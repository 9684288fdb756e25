//! `reference:`, and the reference state of a map file.

use crate::units::{Pressure, Quantity, Temperature};
use mapper_core::ReferenceState;
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
