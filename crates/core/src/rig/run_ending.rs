//! How a run ended.

use serde::{Deserialize, Serialize};

/// How a run ended; its `code` is stable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum RunEnding {
    /// Every step was executed.
    Completed,
    /// Drift was detected, and the campaign asks to stop in that case.
    Drifted {
        /// What drifted.
        reason: String,
    },
    /// The operator stopped it.
    Interrupted {
        /// Run time, s.
        t_s: f64,
    },
    /// A guard tripped.
    Tripped {
        /// Run time, s.
        t_s: f64,
        /// What tripped it.
        reason: String,
    },
    /// Rig, script or recording failed.
    Failed {
        /// The error.
        reason: String,
    },
}
