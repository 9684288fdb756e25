//! The commands of a step: whether they begin with a jump, and when they settle.
//!
//! A closed loop that holds the speed changes P3 slightly all the time. Such a change is no jump, and the command counts as settled.

use mapper_core::{Channel, Recording, SAME_COMMAND_RATIO, StepMarker, is_same_command};

/// Time after a jump from which only the housings still change, s. Bound: several settling times of probe and speed.
pub(crate) const FOLLOWED_S: f64 = 20.0;

/// Gap to the previous step above which the previous command is not the starting point, s. Bound: the housings keep their state over a
/// shorter one.
const MAX_GAP_S: f64 = 60.0;

/// Whether a command changes; an unknown one does not.
fn changed(before: f64, after: f64) -> bool {
    before.is_finite() && after.is_finite() && !is_same_command(before, after)
}

/// Whether the step at `position` of `steps` begins with a change of a command.
///
/// The first step does so only if its marker has the previous command.
pub(crate) fn begins_with_jump(steps: &[StepMarker], position: usize) -> bool {
    let Some(step) = steps.get(position) else { return false };
    if let (Some(from), Some(to)) = (step.from, step.to) {
        return from != to;
    }
    let before = position.checked_sub(1).and_then(|before| steps.get(before));
    before.is_some_and(|before| {
        step.start_s - before.end_s <= MAX_GAP_S
            && (changed(before.p3_pa, step.p3_pa)
                || changed(before.valve_opening_ratio, step.valve_opening_ratio))
    })
}

/// Time of the last change of P3 and valve commands within the step (its start if none is recorded), s. Changes of P3 count until it stays
/// within [`SAME_COMMAND_RATIO`] of its last value, as a loop trims it while the housings warm up.
pub(crate) fn settled_s(recording: &Recording, step: &StepMarker) -> f64 {
    let mut settled_s = step.start_s;
    for channel in [Channel::P3Command, Channel::ValveCommand] {
        let Some(series) = recording.series.get(&channel) else { continue };
        let range = series.range(step.start_s, step.end_s);
        // The change at the step's end belongs to the next one.
        let inside = range.filter(|i| series.t_s[*i] < step.end_s);
        let last = inside.clone().next_back().map(|i| series.values[i]);
        let trimmed = |value: f64| {
            channel == Channel::P3Command
                && last.is_some_and(|last| (value - last).abs() <= SAME_COMMAND_RATIO * last.abs())
        };
        for i in inside {
            let before = i.checked_sub(1).map(|before| series.values[before]);
            if before.is_some_and(|before| changed(before, series.values[i]) && !trimmed(before)) {
                settled_s = settled_s.max(series.t_s[i]);
            }
        }
    }
    settled_s
}
