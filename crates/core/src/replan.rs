//! Whether what is left of a plan is planned again while it is run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When the order of what is left is thought over. Campaigns write it in snake case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum Replan {
    /// Never: the plan is run as it stands.
    #[default]
    Off,
    /// After each step, by what the steps so far have told.
    AfterEachStep,
}

impl Replan {
    /// Whether the plan is run as it stands.
    pub fn is_off(&self) -> bool {
        *self == Replan::Off
    }
}
