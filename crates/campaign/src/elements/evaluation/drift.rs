//! `drift:`

use mapper_core::OnDrift;
use schemars::JsonSchema;
use serde::Deserialize;

/// Reaction to drift.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriftFile {
    /// `hold` ends the run in its safe state; `zero` also requests a zero of the sensors; `continue` notes the drift and continues the run.
    #[schemars(example = &"hold")]
    pub(crate) on_drift: OnDrift,
}
