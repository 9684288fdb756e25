//! Which refinements a joint identification makes, and what is assumed of them beforehand.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether a shared number is taken as declared or found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum Choice {
    /// As declared.
    Fixed,
    /// Found together with the points.
    #[default]
    Fitted,
}

/// How the efficiency moves within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum EfficiencyWithinStep {
    /// It does not.
    Constant,
    /// As a smooth surface through all points does between the sample's place on the map and the step's end.
    #[default]
    Shaped,
}

/// How the heat-transfer coefficient moves within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum ConvectionWithinStep {
    /// It does not, and no point knows of another's.
    Constant,
    /// By a Nusselt law that all points share, each with a deviation of its own.
    #[default]
    Law,
}

/// The refinements of the joint method. With every one switched off it is the dynamic method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JointSettings {
    /// Share of the internal area before compression.
    pub alpha_area: Choice,
    /// Diameter of the T2 probe; `fixed` takes that of `sensors.T2.probe_diameter`.
    pub probe: Choice,
    /// Factor on the heat-transfer coefficient where the metal is hotter than the gas; 1 where `fixed`.
    pub direction: Choice,
    /// Whether the heat-transfer coefficient before the wheel is that after it or follows the inlet's own diameter; as
    /// `machine.geometry` has it where `fixed`.
    pub inlet_h: Choice,
    /// Offsets of the sensors, with their declared uncertainty as prior.
    pub offsets: Choice,
    /// Efficiency within a step: `constant`, or as a surface through all points has it.
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
    /// Nothing but the two numbers of each step: the dynamic method.
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

/// How far the true alpha_A may be off the one that is assumed, one standard deviation, if nothing is said: where nobody has
/// measured it, a tenth to a quarter of the area may lie before the wheel.
pub const ALPHA_AREA_SIGMA_RATIO: f64 = 0.15;
