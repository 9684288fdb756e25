//! The order of a run that was planned again, found once more from its recording.

use crate::SessionError;
use crate::certainty::DwellPrices;
use crate::replanned::{Replanned, SharedPrices};
use mapper_campaign::Campaign;
use mapper_core::{Plan, Recording, Series, StepKind, StepMarker};
use mapper_physics::model::Model;
use mapper_runner::{Certainty, StepSource};
use std::cell::RefCell;

/// The steps that a run of `plan` hands out where its readings are those of a recording, as `executed_plan.json` has them: the order
/// follows from nothing else. A step that the recording has not is one that a guard left out. Runs whose repeats were made again
/// because of drift are not followed beyond that.
///
/// # Errors
/// [`SessionError`] where the plan's forecast fails.
pub fn order_again(
    campaign: &Campaign,
    model: &Model,
    plan: &Plan,
    recording: &Recording,
) -> Result<Plan, SessionError> {
    let Some(prices) = DwellPrices::of(campaign, model, plan)?.map(RefCell::new) else {
        return Ok(plan.clone());
    };
    let mut source = Replanned::new(campaign, model, plan, &prices)?;
    let mut shared = SharedPrices(&prices);
    let mut markers = recording.steps.iter().filter(|marker| marker.kind != StepKind::Approach).peekable();
    let mut end_s = markers.peek().map_or(0.0, |marker| marker.start_s);
    // A plan's steps never fail to come.
    while let Ok(Some(step)) = source.next_step() {
        let _ = shared.bounds(&step);
        let Some(marker) = markers.peek().copied() else { break };
        if marker.to == Some(step.to) && marker.kind == step.kind {
            shared.ended(&part(recording, marker), marker);
            let _ = source.after_step(marker);
            markers.next();
            end_s = marker.end_s;
        } else {
            shared.left_out();
            let left_out = StepMarker {
                index: step.index,
                kind: step.kind,
                start_s: end_s,
                end_s: marker.start_s,
                from: step.from,
                to: Some(step.to),
                p3_pa: step.p3_pa,
                valve_opening_ratio: step.to.valve_opening_ratio,
            };
            let _ = source.skipped(&left_out);
            end_s = marker.start_s;
        }
    }
    Ok(source.handed_out())
}

/// What is read in a step, behind its jump.
fn part(recording: &Recording, marker: &StepMarker) -> Recording {
    let cut = |series: &Series| {
        let behind = |t_s: &f64| *t_s <= marker.start_s + 1e-6;
        let first = series.t_s.partition_point(behind);
        let last = series.t_s.partition_point(|t_s| *t_s <= marker.end_s + 1e-6).max(first);
        Series { t_s: series.t_s[first..last].to_vec(), values: series.values[first..last].to_vec() }
    };
    let series = recording.series.iter().map(|(channel, series)| (*channel, cut(series))).collect();
    Recording { series, steps: vec![*marker], ..Recording::default() }
}
