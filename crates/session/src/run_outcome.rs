//! Outcome of a run.

use crate::journal::COMPLETED;
use mapper_core::Reaction;
use mapper_runner::{RunEnd, RunError};

/// How a run ended.
#[derive(Debug)]
pub enum Ended {
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

impl Ended {
    /// Combines the runner's result with that of the drift watch.
    pub(crate) fn of(end: Result<RunEnd, RunError>, drifted: Option<String>) -> Self {
        match (end, drifted) {
            (Ok(RunEnd::Completed), None) => Ended::Completed,
            (Ok(RunEnd::Completed), Some(reason)) => Ended::Drifted { reason },
            (Ok(RunEnd::Interrupted { t_s }), _) => Ended::Interrupted { t_s },
            (Ok(RunEnd::Tripped(trip)), _) => Ended::Tripped { t_s: trip.t_s, reason: trip.reason },
            (Err(error), _) => Ended::Failed(error),
        }
    }
}

/// Why the rig's state is unknown, or must be inspected before the next run.
pub(crate) fn doubt(end: &Result<RunEnd, RunError>) -> Option<String> {
    match end {
        Ok(RunEnd::Tripped(trip)) if trip.reaction == Reaction::Latch => Some(trip.reason.clone()),
        Err(error) if error.leaves_doubt() => Some(error.to_string()),
        _ => None,
    }
}

/// One sentence for the report on how a run ended.
pub(crate) fn sentence(end: &Ended) -> String {
    let what = match end {
        Ended::Completed => return COMPLETED.to_owned(),
        Ended::Drifted { reason } => format!("({reason})"),
        Ended::Interrupted { t_s } => format!("by the operator at {t_s:.0} s"),
        Ended::Tripped { t_s, reason } => format!("by a guard at {t_s:.1} s ({reason})"),
        // A script's error shows its source line below the first line.
        Ended::Failed(error) => {
            format!("by a fault ({})", error.to_string().lines().next().unwrap_or_default())
        }
    };
    format!("Stopped {what}: the map is not complete.")
}
