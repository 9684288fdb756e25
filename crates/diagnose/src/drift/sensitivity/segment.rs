//! One step of a run, as the model is driven through it.

use crate::drift::causes::planted::Planted;
use crate::drift::runs::time_axis::CampaignStep;
use mapper_core::{Channel, Recording};
use mapper_observe::averages::mean_reading::{BEFORE_S, mean_between};
use mapper_observe::initial_state::estimate_state;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::State;

/// Maximum time steps after a jump: pairs of time after it, s, and maximum step, s.
const STEPS_S: [(f64, f64); 5] = [(0.2, 0.05), (3.0, 0.1), (8.0, 0.5), (20.0, 1.0), (f64::INFINITY, 3.0)];
/// Time for which a jump is left out if the model cannot follow it (deep beyond the surge line), s. Shaft and outlet then start from their
/// readings, the metal from the change of its readings.
pub(crate) const LEFT_OUT_S: f64 = 5.0;
/// Time over which a drifting machine is taken as constant, s.
const PART_S: f64 = 30.0;

/// One step of the run.
pub(crate) struct Stretch {
    pub step: CampaignStep,
    pub start_s: f64,
    pub end_s: f64,
    /// The measured state just before the jump.
    pub read_first: Option<State>,
    /// The measured state [`LEFT_OUT_S`] after the jump.
    pub read_later: Option<State>,
    /// The measured state at the end.
    pub read_last: Option<State>,
    /// How far the model can follow it.
    pub followed: Followed,
    /// Times at which the model is read, and the target of each reading.
    pub times_s: Vec<f64>,
    pub places: Vec<Place>,
}

/// How far the model can follow a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Followed {
    /// From the jump on.
    Whole,
    /// From [`LEFT_OUT_S`] after the jump on, with shaft and outlet as measured there.
    AfterJump,
    /// Not at all: the next step begins with the measured state at the end of this one.
    No,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Place {
    Block(usize),
    StepEnd,
}

impl Stretch {
    /// Ends of the time steps: fine after the jump, coarse when only metal temperatures change.
    pub(crate) fn nodes_s(&self, start_s: f64) -> Vec<f64> {
        let mut nodes = Vec::new();
        let mut at_s = start_s;
        while at_s < self.end_s {
            let since_s = at_s - start_s;
            let step_s = STEPS_S
                .iter()
                .find(|(until_s, _)| since_s < until_s - 1e-9)
                .map_or(3.0, |(_, step_s)| *step_s);
            at_s += step_s;
            nodes.push(at_s);
        }
        nodes
    }

    /// Parts of a segment with a constant machine: the whole segment, unless the machine drifts.
    pub(crate) fn parts(&self, start_s: f64, planted: &[Planted]) -> Vec<(f64, f64)> {
        let mut edges = vec![start_s];
        for Planted { course, .. } in planted.iter().filter(|planted| planted.machine_changes()) {
            let count = ((self.end_s - start_s) / PART_S).ceil().max(1.0);
            edges.extend(
                (1..count as usize).map(|part| start_s + (self.end_s - start_s) * part as f64 / count),
            );
            let onset_s = course.onset_s - self.step.offset_s;
            // Not so close to an end that a part has zero length.
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
pub(crate) fn read_state(recording: &Recording, boundary: &BoundaryConditions, t_s: f64) -> Option<State> {
    let read = |channel| mean_between(recording, channel, t_s - 0.5, t_s + 0.5 + BEFORE_S, 1);
    let all = [Channel::ShaftSpeed, Channel::P2, Channel::Tc, Channel::Tt, Channel::T2];
    let complete = all.iter().all(|channel| read(*channel).is_some_and(|value| value > 0.0));
    complete.then(|| estimate_state(boundary, read))
}

/// The measured state at a later time; the metal uses the change of its readings, without the offsets of its sensors.
pub(crate) fn carried(state: State, first: Option<State>, later: State) -> State {
    let first = first.unwrap_or(State { tc_k: state.tc_k, tt_k: state.tt_k, ..later });
    let tc_k = state.tc_k + later.tc_k - first.tc_k;
    State { tc_k, inner_k: tc_k, tt_k: state.tt_k + later.tt_k - first.tt_k, ..later }
}
