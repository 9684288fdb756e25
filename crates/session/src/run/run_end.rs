//! Outcome of a run.

use mapper_core::{Reaction, RunEnding};
use mapper_runner::{RunEnd, RunError};

/// How a run ended.
#[derive(Debug)]
pub enum RunTermination {
    /// Every step was executed.
    Completed,
    /// Drift was detected, and the campaign asks to stop in that case.
    Drifted {
        /// What drifted.
        reason: String,
    },
    /// A guard tripped.
    Tripped {
        /// Run time, s.
        t_s: f64,
        /// What tripped it.
        reason: String,
    },
    /// The operator stopped it.
    Interrupted {
        /// Run time, s.
        t_s: f64,
    },
    /// Rig, script or recording failed.
    Failed(RunError),
}

impl RunTermination {
    /// Combines the runner's result with that of the drift watch.
    pub(crate) fn from_runner(end: Result<RunEnd, RunError>, drifted: Option<String>) -> Self {
        match (end, drifted) {
            (Ok(RunEnd::Completed), None) => RunTermination::Completed,
            (Ok(RunEnd::Completed), Some(reason)) => RunTermination::Drifted { reason },
            (Ok(RunEnd::Interrupted { t_s }), _) => RunTermination::Interrupted { t_s },
            (Ok(RunEnd::Tripped(trip)), _) => RunTermination::Tripped { t_s: trip.t_s, reason: trip.reason },
            (Err(error), _) => RunTermination::Failed(error),
        }
    }

    /// The same as data for files.
    pub fn ending(&self) -> RunEnding {
        match self {
            RunTermination::Completed => RunEnding::Completed,
            RunTermination::Drifted { reason } => RunEnding::Drifted { reason: reason.clone() },
            RunTermination::Interrupted { t_s } => RunEnding::Interrupted { t_s: *t_s },
            RunTermination::Tripped { t_s, reason } => {
                RunEnding::Tripped { t_s: *t_s, reason: reason.clone() }
            }
            RunTermination::Failed(error) => RunEnding::Failed { reason: error.to_string() },
        }
    }
}

/// Why the rig must be locked out: its state is unknown, or it must be inspected before the next run. `None` if the next run may start.
pub(crate) fn lockout_reason(end: &Result<RunEnd, RunError>) -> Option<String> {
    match end {
        Ok(RunEnd::Tripped(trip)) if trip.reaction == Reaction::Latch => Some(trip.reason.clone()),
        Err(error) if error.leaves_rig_state_unknown() => Some(error.to_string()),
        _ => None,
    }
}
