//! The commands of a step: whether they begin with a jump, and when they come to rest.

use mapper_core::{Channel, Recording, StepMarker};

/// Change of a command below which it counts as held, ratio.
const HELD_RATIO: f64 = 1e-6;

fn changed(before: f64, after: f64) -> bool {
    (after - before).abs() > HELD_RATIO * before.abs().max(after.abs())
}

/// Whether the step at `position` of `steps` begins with a change of what was commanded.
///
/// The first step has none, unless its marker says where it came from.
pub(crate) fn begins_with_jump(steps: &[StepMarker], position: usize) -> bool {
    let Some(step) = steps.get(position) else { return false };
    let planned = matches!((step.from, step.to), (Some(from), Some(to)) if from != to);
    let before = position.checked_sub(1).and_then(|before| steps.get(before));
    match before {
        None => planned,
        Some(before) => {
            planned
                || changed(before.p3_pa, step.p3_pa)
                || changed(before.valve_opening_ratio, step.valve_opening_ratio)
        }
    }
}

/// Time of the last change of P3 and valve commands within the step (its start where none is recorded), s.
pub(crate) fn at_rest_s(recording: &Recording, step: &StepMarker) -> f64 {
    let mut settled_s = step.start_s;
    for channel in [Channel::P3Command, Channel::ValveCommand] {
        let Some(series) = recording.series.get(&channel) else { continue };
        let range = series.range(step.start_s, step.end_s);
        // The change at the step's end belongs to the next one.
        let inside = range.filter(|i| series.t_s[*i] < step.end_s);
        for i in inside {
            let before = i.checked_sub(1).map(|before| series.values[before]);
            if before.is_some_and(|before| changed(before, series.values[i])) {
                settled_s = settled_s.max(series.t_s[i]);
            }
        }
    }
    settled_s
}
