//! Detects impossible steps: a rig is at one operating point at a time, and a number identifies one step.

use crate::reading_checks::failed_check::FailedCheck;
use mapper_core::{Recording, StepConflict, Warning, step_number};

/// Overlap that the rounded times of other loggers explain, s. Bound: half of their second.
const ROUNDED_S: f64 = 0.5;

/// Steps that overlap in time or share a number.
pub(crate) fn failed_checks(recording: &Recording) -> Vec<FailedCheck> {
    let steps = &recording.steps;
    let mut found = Vec::new();
    let mut by_time: Vec<usize> = (0..steps.len()).filter(|i| steps[*i].start_s < steps[*i].end_s).collect();
    by_time.sort_by(|a, b| steps[*a].start_s.total_cmp(&steps[*b].start_s));
    // The step with the latest end so far: a step that begins before that end overlaps it.
    let mut furthest: Option<usize> = None;
    for &position in &by_time {
        let step = &steps[position];
        if let Some(before) = furthest.filter(|before| steps[*before].end_s > step.start_s + ROUNDED_S) {
            let overlap = StepConflict::Overlap {
                first: step_number(steps[before].index),
                first_start_s: steps[before].start_s,
                first_end_s: steps[before].end_s,
                second: step_number(step.index),
                second_start_s: step.start_s,
                second_end_s: step.end_s,
            };
            found.push(FailedCheck::new(Warning::StepsContradict(overlap), vec![before, position]));
        }
        if furthest.is_none_or(|before| steps[before].end_s < step.end_s) {
            furthest = Some(position);
        }
    }
    let mut by_index: Vec<usize> = (0..steps.len()).collect();
    by_index.sort_by_key(|position| steps[*position].index);
    for same in by_index.chunk_by(|a, b| steps[*a].index == steps[*b].index).filter(|same| same.len() > 1) {
        let shared =
            StepConflict::SharedNumber { number: step_number(steps[same[0]].index), steps: same.len() };
        found.push(FailedCheck::new(Warning::StepsContradict(shared), same.to_vec()));
    }
    found
}
