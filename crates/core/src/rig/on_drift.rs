//! Reaction to drift of the rig during a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Reaction if two repeats of a jump differ from its first visit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::flatten_to_names)]
pub enum OnDrift {
    /// The run ends in the safe state, for inspection by an operator.
    Hold,
    /// The run continues; the recording has a note.
    Continue,
    /// The run ends in the safe state, without flow, and asks for a zero of the sensors.
    Zero,
}
