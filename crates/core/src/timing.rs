//! How long the parts of a campaign take.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What ends the dwell at a point. Campaigns write it in snake case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum DwellEnd {
    /// The time that the plan has for it.
    #[default]
    Planned,
    /// What its readings tell: when more time there tells less of all points than elsewhere, as long as that takes.
    WhenCertain,
}

impl DwellEnd {
    /// Whether the plan alone has the say.
    pub fn is_planned(&self) -> bool {
        *self == DwellEnd::Planned
    }
}

/// Durations of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Time at the first point before its step begins, s, >= 0.
    pub warm_up_s: f64,
    /// Time without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Time at each point, jump included, s, > 0; the longest where each step's dwell is chosen.
    pub dwell_s: f64,
    /// What ends the dwell; the longest is `dwell_s` in any case.
    #[serde(default, skip_serializing_if = "DwellEnd::is_planned")]
    pub ends: DwellEnd,
}
