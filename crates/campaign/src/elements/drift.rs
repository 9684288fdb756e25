//! `drift:`

use mapper_core::OnDrift;
use schemars::JsonSchema;
use serde::Deserialize;

/// What is done about drift.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriftFile {
    /// `hold` ends the run in its safe state, `zero` too and asks for a zero of the sensors, `continue` goes on with a note.
    #[schemars(example = &"hold")]
    pub(crate) on_drift: OnDrift,
}
