//! Definitions of isentropic efficiency in use for compressors.

use serde::{Deserialize, Serialize};

/// The definition of an isentropic efficiency.
///
/// Definitions differ in the conversion of temperatures to work: by up to 0.2 points at a pressure ratio of 2 and 0.7 at 4.
/// An efficiency is therefore meaningful only together with its definition.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EfficiencyDefinition {
    /// Isentropic over actual rise of specific enthalpy, `(h(T2s) - h(T1))/(h(T2) - h(T1))`, with the heat capacity as a function of
    /// temperature (ASME PTC 10).
    #[default]
    Enthalpy,
    /// `T1 (PR^((gamma - 1)/gamma) - 1)/(T2 - T1)` with this ratio of heat capacities, above 1.
    ConstantGamma(f64),
    /// `T1 (PR^kappa - 1)/(T2 - T1)` with `kappa = R/cp(T1)` (Burke et al., eq. 2).
    #[serde(rename = "kappa_of_T1")]
    KappaOfT1,
}

impl EfficiencyDefinition {
    /// The definition in words, for readers of a report.
    pub fn description(self) -> String {
        match self {
            EfficiencyDefinition::Enthalpy => {
                "ratio of enthalpy rises, heat capacity as a function of temperature".to_owned()
            }
            EfficiencyDefinition::ConstantGamma(gamma) => {
                format!("ratio of temperature rises, gamma = {gamma}")
            }
            EfficiencyDefinition::KappaOfT1 => "ratio of temperature rises, gamma at T1".to_owned(),
        }
    }
}

/// The definition as text for files and options: `enthalpy`, `kappa_of_T1`, `constant_gamma 1.4`.
impl std::fmt::Display for EfficiencyDefinition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            EfficiencyDefinition::Enthalpy => f.write_str("enthalpy"),
            EfficiencyDefinition::ConstantGamma(gamma) => write!(f, "constant_gamma {gamma}"),
            EfficiencyDefinition::KappaOfT1 => f.write_str("kappa_of_T1"),
        }
    }
}

/// A text that names no definition.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a definition of efficiency; write `enthalpy`, `kappa_of_T1`, or `constant_gamma 1.4` with a value between 1 and 2"
)]
pub struct UnknownEfficiency(String);

impl std::str::FromStr for EfficiencyDefinition {
    type Err = UnknownEfficiency;

    fn from_str(text: &str) -> Result<Self, UnknownEfficiency> {
        let unknown = || UnknownEfficiency(crate::one_line(text).chars().take(60).collect());
        match text.trim() {
            "enthalpy" => Ok(EfficiencyDefinition::Enthalpy),
            "kappa_of_T1" => Ok(EfficiencyDefinition::KappaOfT1),
            other => {
                let gamma = other.strip_prefix("constant_gamma").and_then(|rest| rest.trim().parse().ok());
                // A diatomic gas has 1.4, a monatomic gas 5/3, the maximum of kinetic theory.
                let gamma = gamma.filter(|gamma: &f64| *gamma > 1.0 && *gamma < 2.0).ok_or_else(unknown)?;
                Ok(EfficiencyDefinition::ConstantGamma(gamma))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_read_back() {
        for definition in [
            EfficiencyDefinition::Enthalpy,
            EfficiencyDefinition::KappaOfT1,
            EfficiencyDefinition::ConstantGamma(1.395),
        ] {
            assert_eq!(definition.to_string().parse(), Ok(definition));
        }
        for wrong in ["", "constant_gamma", "constant_gamma 1", "constant_gamma NaN", "polytropic"] {
            assert!(wrong.parse::<EfficiencyDefinition>().is_err());
        }
    }
}
