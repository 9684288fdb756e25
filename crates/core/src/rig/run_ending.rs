//! The end of a run.

use serde::{Deserialize, Serialize};

/// Reason for the end of a run; its `code` is stable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
#[allow(missing_docs, reason = "the variants describe their values")]
pub enum RunEnding {
    /// Every step was executed.
    Completed,
    /// Drift was detected, and the campaign asks to stop in that case.
    Drifted { reason: String },
    /// The operator stopped the run at this run time.
    Interrupted { t_s: f64 },
    /// A guard tripped at this run time.
    Tripped { t_s: f64, reason: String },
    /// The rig, the script or the recording failed.
    Failed { reason: String },
}
