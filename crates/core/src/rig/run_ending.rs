//! The end of a run.

use serde::{Deserialize, Serialize};

/// Reason for the end of a run; its `code` is stable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum RunEnding {
    /// Every step was executed.
    Completed,
    /// Drift was detected, and the campaign asks to stop in that case.
    Drifted {
        /// Description of the drift.
        reason: String,
    },
    /// The operator stopped the run.
    Interrupted {
        /// Run time, s.
        t_s: f64,
    },
    /// A guard tripped.
    Tripped {
        /// Run time, s.
        t_s: f64,
        /// Cause of the trip.
        reason: String,
    },
    /// The rig, the script or the recording failed.
    Failed {
        /// The error.
        reason: String,
    },
}
