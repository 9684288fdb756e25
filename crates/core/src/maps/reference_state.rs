//! Reference states of corrected quantities, and definitions of the efficiency.

use serde::{Deserialize, Serialize};

/// Range of a reference temperature, K. Bound: no test cell is outside it.
const TEMPERATURES_K: std::ops::RangeInclusive<f64> = 200.0..=400.0;
/// Range of a reference pressure, Pa. Bound: one atmosphere is inside it, a number in another unit is not.
const PRESSURES_PA: std::ops::RangeInclusive<f64> = 50e3..=200e3;

/// Reference total temperature and pressure of corrected quantities.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReferenceState {
    /// Reference temperature, K.
    pub t_ref_k: f64,
    /// Reference pressure, Pa.
    pub p_ref_pa: f64,
}

impl ReferenceState {
    /// 298 K, 100 kPa. Source: SAE J922.
    pub const SAE: ReferenceState = ReferenceState { t_ref_k: 298.0, p_ref_pa: 100_000.0 };

    /// Source: as printed on Garrett maps: 545 degR, 13.95 psia (a pound-force over a square inch, exactly).
    pub const GARRETT: ReferenceState =
        ReferenceState { t_ref_k: 545.0 * 5.0 / 9.0, p_ref_pa: 13.95 * 4.448_221_615_260_5 / 0.000_645_16 };

    /// Source: as printed on BorgWarner maps: 293 K, 98.1 kPa.
    pub const BORGWARNER: ReferenceState = ReferenceState { t_ref_k: 293.0, p_ref_pa: 98_100.0 };

    /// The state with this name, ignoring case.
    pub fn named(name: &str) -> Option<ReferenceState> {
        NAMED_REFERENCES.iter().find(|row| row.name.eq_ignore_ascii_case(name.trim())).map(|row| row.state)
    }

    /// Whether both numbers form a valid reference state: 200 K to 400 K, 50 kPa to 200 kPa.
    pub fn is_plausible(&self) -> bool {
        TEMPERATURES_K.contains(&self.t_ref_k) && PRESSURES_PA.contains(&self.p_ref_pa)
    }

    /// Factor that converts a corrected flow of this reference state to `other`.
    pub fn flow_factor_to(&self, other: ReferenceState) -> f64 {
        (other.p_ref_pa / self.p_ref_pa) * (self.t_ref_k / other.t_ref_k).sqrt()
    }

    /// Factor that converts a corrected speed of this reference state to `other`.
    pub fn speed_factor_to(&self, other: ReferenceState) -> f64 {
        (other.t_ref_k / self.t_ref_k).sqrt()
    }

    /// Corrected shaft speed `N sqrt(T_ref/T1)`, rpm.
    pub fn corrected_speed_rpm(&self, speed_rpm: f64, t1_total_k: f64) -> f64 {
        speed_rpm * (self.t_ref_k / t1_total_k).sqrt()
    }

    /// Physical shaft speed of a corrected one, rpm.
    pub fn physical_speed_rpm(&self, speed_corrected_rpm: f64, t1_total_k: f64) -> f64 {
        speed_corrected_rpm * (t1_total_k / self.t_ref_k).sqrt()
    }

    /// Corrected mass flow `m sqrt(T1/T_ref) / (P1/P_ref)`, kg/s.
    pub fn corrected_flow_kg_s(&self, flow_kg_s: f64, t1_total_k: f64, p1_total_pa: f64) -> f64 {
        flow_kg_s * (t1_total_k / self.t_ref_k).sqrt() / (p1_total_pa / self.p_ref_pa)
    }

    /// Physical mass flow of a corrected one, kg/s.
    pub fn physical_flow_kg_s(&self, flow_corrected_kg_s: f64, t1_total_k: f64, p1_total_pa: f64) -> f64 {
        flow_corrected_kg_s * (p1_total_pa / self.p_ref_pa) / (t1_total_k / self.t_ref_k).sqrt()
    }
}

/// A named reference state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedReference {
    /// Name as written in campaigns and on the command line.
    pub name: &'static str,
    /// The state.
    pub state: ReferenceState,
    /// Text on printed maps.
    pub printed: &'static str,
}

/// All named reference states.
pub const NAMED_REFERENCES: &[NamedReference] = &[
    NamedReference { name: "SAE", state: ReferenceState::SAE, printed: "298 K, 100 kPa" },
    NamedReference { name: "Garrett", state: ReferenceState::GARRETT, printed: "545 degR, 13.95 psia" },
    NamedReference { name: "BorgWarner", state: ReferenceState::BORGWARNER, printed: "293 K, 98.1 kPa" },
];

/// The common choices in a sentence: `SAE (298 K, 100 kPa), Garrett (...), ...`.
pub fn usual_references() -> String {
    let rows: Vec<String> =
        NAMED_REFERENCES.iter().map(|row| format!("{} ({})", row.name, row.printed)).collect();
    rows.join(", ")
}

impl std::fmt::Display for ReferenceState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // For display: a hundredth of a permille does not matter. Files carry all digits.
        let short = |value: f64| (value * 1e3).round() / 1e3;
        write!(f, "{} K, {} kPa", short(self.t_ref_k), short(self.p_ref_pa / 1e3))
    }
}

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
    fn named_states_are_what_the_makers_print() {
        // 545 degR = 302.778 K, 13.95 psia = 96 182 Pa.
        assert!((ReferenceState::GARRETT.t_ref_k - 302.778).abs() < 1e-3);
        assert!((ReferenceState::GARRETT.p_ref_pa - 96_182.0).abs() < 1.0);
        assert_eq!(ReferenceState::named("borgwarner"), Some(ReferenceState::BORGWARNER));
        assert_eq!(ReferenceState::named("ISO"), None);
        assert!(NAMED_REFERENCES.iter().all(|row| row.state.is_plausible()));
    }

    #[test]
    fn a_change_of_reference_is_a_way_over_the_physical_values() {
        let (from, to) = (ReferenceState::SAE, ReferenceState::GARRETT);
        let (t1_k, p1_pa) = (311.0, 97_000.0);
        let flow = from.physical_flow_kg_s(0.1, t1_k, p1_pa);
        let speed = from.physical_speed_rpm(90e3, t1_k);
        assert!((to.corrected_flow_kg_s(flow, t1_k, p1_pa) - 0.1 * from.flow_factor_to(to)).abs() < 1e-15);
        assert!((to.corrected_speed_rpm(speed, t1_k) - 90e3 * from.speed_factor_to(to)).abs() < 1e-9);
    }

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
