//! The end of a run, the same for the runner, the journal and the reports.

use crate::rig::guard::{GuardName, Reaction};
use serde::{Deserialize, Serialize};

/// The report of a guard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trip {
    /// Run time, s.
    pub t_s: f64,
    /// The guard that tripped.
    pub guard: GuardName,
    /// The required reaction.
    pub reaction: Reaction,
    /// One sentence with values and units.
    pub reason: String,
}

/// How a run ended; its `code` is stable. The rig is safe in all cases.
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
    /// A guard tripped.
    Tripped(Trip),
    /// The rig, the script or the recording failed. The runner reports it as an error; files have it as this.
    Failed { reason: String },
}
