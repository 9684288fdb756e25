//! How the gas before the compressor's wheel exchanges heat with the housing.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Model of the heat-transfer coefficient before the wheel. It matters only if part of the internal area lies there
/// (alpha_A above 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum InletConvection {
    /// One coefficient before and after compression, as eqs. 1 and 3 of Burke et al. have it.
    #[default]
    Shared,
    /// Its own, by the Nusselt law of the outlet at the inlet's diameter and the inlet's temperature (their Appendix A).
    Own,
}

impl InletConvection {
    /// The other of the two.
    pub fn other(self) -> Self {
        match self {
            InletConvection::Shared => InletConvection::Own,
            InletConvection::Own => InletConvection::Shared,
        }
    }
}
