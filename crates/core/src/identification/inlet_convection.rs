//! Heat transfer between the gas upstream of the compressor wheel and the housing.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Model of the heat-transfer coefficient upstream of the wheel. It matters only if part of the internal area lies upstream (alpha_A above 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::flatten_to_names)]
pub enum InletConvection {
    /// The same coefficient upstream and downstream of the wheel, as in eqs. 1 and 3 of Burke et al.
    #[default]
    Shared,
    /// A separate coefficient, from the Nusselt law of the outlet with diameter and temperature of the inlet (their Appendix A).
    Own,
}

impl InletConvection {
    /// The other model.
    pub fn other(self) -> Self {
        match self {
            InletConvection::Shared => InletConvection::Own,
            InletConvection::Own => InletConvection::Shared,
        }
    }
}
