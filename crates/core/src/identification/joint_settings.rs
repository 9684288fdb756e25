//! Parameters that a joint identification estimates, and their prior assumptions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether a shared parameter is taken as declared or estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::flatten_to_names)]
pub enum Choice {
    /// As declared.
    Fixed,
    /// Estimated together with the points.
    #[default]
    Fitted,
}

/// Variation of the efficiency within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::flatten_to_names)]
pub enum EfficiencyWithinStep {
    /// Constant.
    Constant,
    /// Varies as a smooth surface through all points does, between the sample's position on the map and the end of the step.
    #[default]
    Shaped,
}

/// Variation of the heat-transfer coefficient within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::flatten_to_names)]
pub enum ConvectionWithinStep {
    /// Constant, and independent of the other points.
    Constant,
    /// Follows a Nusselt law that all points share; each point has its own deviation from it.
    #[default]
    Law,
}

/// The shared parameters of the joint method. With all of them switched off it is the dynamic method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JointSettings {
    /// Share of the internal area before compression.
    pub alpha_area: Choice,
    /// Diameter of the T2 probe; `fixed` takes that of `sensors.T2.probe_diameter`.
    pub probe: Choice,
    /// Factor on the heat-transfer coefficient if the metal is hotter than the gas; 1 if `fixed`.
    pub direction: Choice,
    /// Whether the heat-transfer coefficient upstream of the wheel equals that downstream or follows the inlet's own diameter; as in
    /// `machine.geometry` if `fixed`.
    pub inlet_h: Choice,
    /// Offsets of the sensors, with their declared uncertainty as prior.
    pub offsets: Choice,
    /// Efficiency within a step: `constant`, or from a surface through all points.
    pub efficiency: EfficiencyWithinStep,
    /// Heat-transfer coefficient within a step: `constant`, or by a law that all points share.
    pub h: ConvectionWithinStep,
}

impl Default for JointSettings {
    fn default() -> Self {
        JointSettings {
            alpha_area: Choice::Fitted,
            probe: Choice::Fitted,
            direction: Choice::Fitted,
            inlet_h: Choice::Fitted,
            offsets: Choice::Fitted,
            efficiency: EfficiencyWithinStep::Shaped,
            h: ConvectionWithinStep::Law,
        }
    }
}

impl JointSettings {
    /// Keys of the parameters that are taken as declared.
    pub fn held_fixed(&self) -> Vec<String> {
        let parameters = [
            ("alpha_area", self.alpha_area),
            ("probe", self.probe),
            ("direction", self.direction),
            ("inlet_h", self.inlet_h),
            ("offsets", self.offsets),
        ];
        let fixed = parameters.into_iter().filter(|(_, choice)| *choice == Choice::Fixed);
        fixed.map(|(key, _)| key.to_owned()).collect()
    }

    /// Only the two parameters of each step: the dynamic method.
    pub fn all_off() -> Self {
        JointSettings {
            alpha_area: Choice::Fixed,
            probe: Choice::Fixed,
            direction: Choice::Fixed,
            inlet_h: Choice::Fixed,
            offsets: Choice::Fixed,
            efficiency: EfficiencyWithinStep::Constant,
            h: ConvectionWithinStep::Constant,
        }
    }
}

/// Default uncertainty of the assumed alpha_A, one standard deviation: if it has not been
/// measured, a tenth to a quarter of the area may lie before the wheel.
pub const ALPHA_AREA_SIGMA_RATIO: f64 = 0.15;
