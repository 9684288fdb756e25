//! The end of a run, or the origin of its points, as a sentence.

use mapper_core::{Method, RunEnding, Trip};

/// Where the points of a report come from.
#[derive(Debug, Clone, PartialEq)]
pub enum PointsOrigin {
    /// A run.
    Run(RunEnding),
    /// Recordings.
    Recordings(Method),
}

impl PointsOrigin {
    /// Whether every planned step is among the points.
    pub fn is_complete(&self) -> bool {
        !matches!(self, PointsOrigin::Run(ending) if *ending != RunEnding::Completed)
    }

    /// One sentence.
    pub fn sentence(&self) -> String {
        match self {
            PointsOrigin::Run(ending) => ending_sentence(ending),
            PointsOrigin::Recordings(method) => format!("Identified by the method `{method}`."),
        }
    }
}

/// One sentence on how a run ended.
pub fn ending_sentence(ending: &RunEnding) -> String {
    let stop = match ending {
        RunEnding::Completed => return "Completed.".to_owned(),
        RunEnding::Drifted { reason } => format!("({reason})"),
        RunEnding::Interrupted { t_s } => format!("by the operator at {t_s:.0} s"),
        RunEnding::Tripped(Trip { t_s, reason, .. }) => format!("by a guard at {t_s:.1} s ({reason})"),
        // A script's error shows its source line below the first line.
        RunEnding::Failed { reason } => {
            format!("by a fault ({})", reason.lines().next().unwrap_or_default())
        }
    };
    format!("Stopped {stop}: the map is not complete.")
}
