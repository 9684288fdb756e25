//! The dwell that a step needs to settle in time for a good verdict.

use mapper_core::{PlanStep, WindowRule};

/// Time at the end of a step, s, that must be settled for a good verdict.
pub(crate) fn settled_time_s(dwell_s: f64, joint: bool) -> f64 {
    if joint { WindowRule::settled_end_s(dwell_s) } else { WindowRule::SHORTEST_S }
}

/// Dwell, s, that a step needs for `window: auto`.
pub(crate) fn needed_dwell_s(step: &PlanStep, joint: bool) -> f64 {
    let earliest_s = if joint { 0.0 } else { WindowRule::EARLIEST_S };
    step.predicted.settle_s.unwrap_or(f64::INFINITY).max(earliest_s) + settled_time_s(step.dwell_s, joint)
}
