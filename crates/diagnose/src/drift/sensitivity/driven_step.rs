//! One step of a run through which the model is driven.

use crate::drift::causes::drift::Drift;
use crate::drift::runs::time_axis::CampaignStep;
use mapper_core::{Channel, Recording};
use mapper_observe::averages::mean_reading::{BEFORE_S, mean_between};
use mapper_observe::initial_state::estimate_state;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::State;

/// Longest time step, s, until each time after a jump, s.
const TIME_STEPS_S: [(f64, f64); 5] =
    [(0.2, 0.05), (3.0, 0.1), (8.0, 0.5), (20.0, 1.0), (f64::INFINITY, 3.0)];
/// Time after a jump that is left out if the model cannot follow the jump (deep beyond the surge line), s. Shaft and outlet then start from their
/// readings, the metal from the change of its readings.
pub(crate) const SKIPPED_S: f64 = 5.0;
/// Longest time for which a drifting machine is taken as constant, s: a drift of 1 K in an hour changes by 0.01 K in it, below any sensor's
/// resolution.
const PART_S: f64 = 30.0;

/// One step of a run.
pub(crate) struct DrivenStep {
    pub step: CampaignStep,
    pub start_s: f64,
    pub end_s: f64,
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
    /// Ends of the time steps: short after the jump, longer when only metal temperatures change.
    pub(crate) fn nodes_s(&self, start_s: f64) -> Vec<f64> {
        let mut nodes = Vec::new();
        let mut at_s = start_s;
        while at_s < self.end_s {
            let since_s = at_s - start_s;
            let step_s = TIME_STEPS_S
                .iter()
                .find(|(until_s, _)| since_s < until_s - 1e-9)
                .map_or(3.0, |(_, step_s)| *step_s);
            at_s += step_s;
            nodes.push(at_s);
        }
        nodes
    }

    /// Parts with a constant machine: the whole step, unless the machine drifts.
    pub(crate) fn parts(&self, start_s: f64, drifts: &[Drift]) -> Vec<(f64, f64)> {
        let mut edges = vec![start_s];
        for drift in drifts.iter().filter(|drift| drift.acts_on_machine()) {
            let count = ((self.end_s - start_s) / PART_S).ceil().max(1.0);
            edges.extend(
                (1..count as usize).map(|part| start_s + (self.end_s - start_s) * part as f64 / count),
            );
            let onset_s = drift.history.onset_s - self.step.offset_s;
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
