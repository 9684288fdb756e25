//! One step of a run through which the model is driven.

use crate::drift::causes::drift::Drift;
use crate::drift::runs::time_axis::{CampaignStep, SEGMENTS};
use mapper_core::{Channel, Recording};
use mapper_observe::averages::mean_reading::{BEFORE_S, mean_between};
use mapper_observe::initial_state::estimate_state;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::State;

/// Time after a jump that is left out if the model cannot follow the jump (deep beyond the surge line), s. Shaft and outlet then start from their
/// readings, the metal from the change of its readings.
pub(crate) const SKIPPED_S: f64 = SEGMENTS.first_s;

/// One step of a run.
pub(crate) struct DrivenStep {
    pub step: CampaignStep,
    pub start_s: f64,
    pub end_s: f64,
    /// Starts of its segments.
    pub segments_s: Vec<f64>,
    /// Measured state just before the jump.
    pub before_jump: Option<State>,
    /// Measured state [`SKIPPED_S`] after the jump.
    pub after_jump: Option<State>,
    /// Measured state at the end.
    pub at_end: Option<State>,
    /// The part that the model can follow.
    pub coverage: Coverage,
    /// Times at which the model is read, and the target of each reading.
    pub times_s: Vec<f64>,
    pub targets: Vec<Target>,
}

/// The part of a step that the model can follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coverage {
    Whole,
    /// From [`SKIPPED_S`] after the jump on, starting with the measured shaft and outlet.
    AfterJump,
    /// The next step starts with the measured state at the end of this one.
    None,
}

/// Target of a model reading.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Target {
    Segment(usize),
    StepEnd,
}

impl DrivenStep {
    /// Parts with a constant machine: the whole step, or its segments if the machine drifts. Only the mean over a segment is compared.
    pub(crate) fn parts(&self, start_s: f64, drifts: &[Drift]) -> Vec<(f64, f64)> {
        let mut edges = vec![start_s];
        for drift in drifts.iter().filter(|drift| drift.acts_on_machine()) {
            edges.extend(self.segments_s.iter().filter(|segment_s| **segment_s > start_s));
            let onset_s = drift.history.onset - self.step.offset_s;
            // A part must not have zero length.
            if (start_s + 0.1..self.end_s - 0.1).contains(&onset_s) {
                edges.push(onset_s);
            }
            edges.sort_by(f64::total_cmp);
            edges.dedup_by(|b, a| *b - *a < 0.05);
        }
        edges.push(self.end_s);
        edges.windows(2).map(|pair| (pair[0], pair[1])).collect()
    }
}

/// The measured state around a time; `None` if one of its channels is missing.
pub(crate) fn measured_state(
    recording: &Recording,
    boundary: &BoundaryConditions,
    t_s: f64,
) -> Option<State> {
    let read = |channel| mean_between(recording, channel, t_s - 0.5, t_s + 0.5 + BEFORE_S, 1);
    let all = [Channel::ShaftSpeed, Channel::P2, Channel::Tc, Channel::Tt, Channel::T2];
    let complete = all.iter().all(|channel| read(*channel).is_some_and(|value| value > 0.0));
    complete.then(|| estimate_state(boundary, read))
}

/// The state after a skipped part: as `measured` there, but with the metal of `state` plus the measured change since `before`, so that offsets of
/// the metal sensors cancel.
pub(crate) fn state_after(state: State, before: Option<State>, measured: State) -> State {
    let before = before.unwrap_or(State { tc_k: state.tc_k, tt_k: state.tt_k, ..measured });
    let tc_k = state.tc_k + measured.tc_k - before.tc_k;
    State { tc_k, inner_k: tc_k, tt_k: state.tt_k + measured.tt_k - before.tt_k, ..measured }
}
