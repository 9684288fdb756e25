//! The nominal model through a whole run, and how its readings answer to each knob.

use crate::DriftError;
use crate::blocks::{Block, CampaignStep, OUTPUTS};
use crate::inputs::{self, RecordedInputs};
use crate::knob::Knob;
use crate::planted::Planted;
use mapper_core::{Channel, Recording};
use mapper_physics::driven::{DriveError, FrozenGrid, drive, settle};
use mapper_physics::inputs::Inputs;
use mapper_physics::instruments::true_value;
use mapper_physics::model::{Model, State, rad_s_of_rpm};
use mapper_physics::params::BoundaryConditions;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Readings of the model within a stretch, s apart.
const SAMPLE_S: f64 = 2.5;
/// Longest steps after a jump: up to so many seconds, steps of at most so many seconds.
const STEPS_S: [(f64, f64); 5] = [(0.2, 0.05), (3.0, 0.1), (8.0, 0.5), (20.0, 1.0), (f64::INFINITY, 3.0)];
/// A jump that the model cannot follow (deep beyond the surge line) is left out for this long, s: shaft and outlet then
/// stand where they were read, the metal as far from where it was as its sensors say.
const LEFT_OUT_S: f64 = 5.0;
/// A machine that drifts is taken as constant over this long, s, or over the so-manieth part of a long step.
const PART_S: f64 = 30.0;
const MOST_PARTS: f64 = 60.0;
/// Readings this long before the start say what state it is in, s.
const BEFORE_S: f64 = 2.0;

/// What the model says of one run.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Means over the stretches, [`OUTPUTS`] in each.
    pub means: Vec<[f64; OUTPUTS.len()]>,
    /// Highest place on the speed line within each stretch; 1 is the surge line.
    pub surge_position_ratio: Vec<f64>,
    /// Efficiency and heat-transfer coefficient, W/(m2 K), at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
}

/// One run, ready to be driven.
pub(crate) struct Drive<'a> {
    model: &'a Model,
    inputs: RecordedInputs,
    start: State,
    stretches: Vec<Stretch>,
    blocks: usize,
}

/// One step of the run.
struct Stretch {
    step: CampaignStep,
    start_s: f64,
    end_s: f64,
    /// The state as read just before the jump.
    read_first: Option<State>,
    /// The state as read [`LEFT_OUT_S`] after the jump.
    read_later: Option<State>,
    /// The state as read at the end.
    read_last: Option<State>,
    /// How far the model can follow it.
    followed: Followed,
    /// Times at which the model is read, and where each reading belongs.
    times_s: Vec<f64>,
    places: Vec<Place>,
}

/// How far the model can follow a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Followed {
    /// From the jump on.
    Whole,
    /// From [`LEFT_OUT_S`] after the jump on, shaft and outlet as read there.
    AfterJump,
    /// Not at all: the next step begins with what was read at the end of this one.
    No,
}

#[derive(Debug, Clone, Copy)]
enum Place {
    Block(usize),
    StepEnd,
}

impl<'a> Drive<'a> {
    /// Prepares run `run`; `steps` and `blocks` are all of the campaign.
    pub fn new(
        run: usize,
        recording: &Recording,
        model: &'a Model,
        nominal: &BoundaryConditions,
        steps: &[CampaignStep],
        blocks: &[Block],
    ) -> Result<Self, DriftError> {
        let unusable = |message: String| DriftError::Unusable { run, message };
        let of_run: Vec<(usize, &CampaignStep)> =
            steps.iter().enumerate().filter(|(_, step)| step.run == run).collect();
        let (Some((_, first)), Some((_, last))) = (of_run.first(), of_run.last()) else {
            return Err(unusable("it has no steps; commands that change make steps".to_owned()));
        };
        let jumps: Vec<(f64, f64)> =
            of_run.iter().map(|(_, step)| (step.start_s, step.valve_opening_ratio)).collect();
        let inputs = inputs::recorded(recording, nominal, &jumps, last.end_s)
            .map_err(|error| unusable(format!("its inputs cannot be used: {error}")))?;
        let start = start_state(run, recording, model, &inputs, first.start_s)?;
        let mut block_count = 0;
        let mut stretches = Vec::new();
        for (position, step) in &of_run {
            let mut stretch = Stretch {
                step: **step,
                start_s: step.start_s,
                end_s: step.end_s,
                read_first: read_state(recording, step.start_s - 0.6),
                read_later: read_state(recording, step.start_s + LEFT_OUT_S),
                read_last: read_state(recording, step.end_s - 1.0),
                followed: Followed::Whole,
                times_s: Vec::new(),
                places: Vec::new(),
            };
            for block in blocks.iter().filter(|block| block.step == *position) {
                let count = (block.length_s() / SAMPLE_S).round().max(1.0) as usize;
                for index in 0..count {
                    let share = (index as f64 + 0.5) / count as f64;
                    stretch.times_s.push(block.start_s + share * block.length_s());
                    stretch.places.push(Place::Block(block_count));
                }
                block_count += 1;
            }
            stretch.times_s.push(step.end_s - 1e-3);
            stretch.places.push(Place::StepEnd);
            stretches.push(stretch);
        }
        Ok(Drive { model, inputs, start, stretches, blocks: block_count })
    }

    /// The run with one knob turned, or none, beside what is planted. An error names the stretch that the model could not
    /// follow.
    fn predict(
        &self,
        planted: Option<Planted>,
        turned: Option<(Knob, f64)>,
    ) -> Result<Prediction, (usize, DriveError)> {
        let mut state = self.start;
        if let Some((knob, by)) = turned {
            match knob {
                Knob::InitialTc => {
                    state.tc_k += by;
                    state.inner_k += by;
                }
                Knob::InitialTt => state.tt_k += by,
                _ => {}
            }
        }
        let mut prediction = Prediction {
            means: vec![[0.0; OUTPUTS.len()]; self.blocks],
            surge_position_ratio: vec![f64::NEG_INFINITY; self.blocks],
            step_ends: vec![(f64::NAN, f64::NAN); self.stretches.len()],
        };
        let mut counts = vec![0_usize; self.blocks];
        for (index, stretch) in self.stretches.iter().enumerate() {
            let mut start_s = stretch.start_s;
            match (stretch.followed, stretch.read_later, stretch.read_last) {
                (Followed::AfterJump, Some(read), _) => {
                    start_s += LEFT_OUT_S;
                    state = carried(state, stretch.read_first, read);
                }
                (Followed::No, _, Some(read)) => {
                    state = carried(state, stretch.read_first, read);
                    continue;
                }
                _ => {}
            }
            let offset_s = stretch.step.offset_s;
            let inputs = Turned { inputs: &self.inputs, turned, planted, offset_s };
            let nodes = nodes_s(stretch, start_s);
            for (from_s, to_s) in parts(stretch, start_s, planted) {
                let mut model = self.model.clone();
                if let Some((knob, by)) = turned {
                    knob.turn(&mut model.params, by);
                }
                if let Some(planted) = planted {
                    planted.drift_machine(&mut model.params, from_s + offset_s, to_s + offset_s);
                }
                let before = stretch.times_s.partition_point(|t_s| *t_s < from_s);
                let times_s = &stretch.times_s[before..];
                let times_s = &times_s[..times_s.partition_point(|t_s| *t_s < to_s)];
                let grid = FrozenGrid::new(from_s, to_s, &[], &nodes);
                let step_ends = &mut prediction.step_ends;
                let (means, highest) = (&mut prediction.means, &mut prediction.surge_position_ratio);
                state = drive(&model, &inputs, state, &grid, times_s, |reading, prepared, state, outputs| {
                    match stretch.places[before + reading] {
                        Place::StepEnd => step_ends[index] = (outputs.efficiency, outputs.h_w_m2k),
                        Place::Block(block) => {
                            for (sum, channel) in means[block].iter_mut().zip(OUTPUTS) {
                                *sum += true_value(channel, prepared, state, outputs).unwrap_or(f64::NAN);
                            }
                            highest[block] = highest[block].max(outputs.surge_position_ratio);
                            counts[block] += 1;
                        }
                    }
                })
                .map_err(|error| (index, error))?;
            }
        }
        for (means, count) in prediction.means.iter_mut().zip(counts) {
            // Nothing was said of a stretch that was not followed.
            means.iter_mut().for_each(|sum| *sum /= count as f64);
        }
        Ok(prediction)
    }

    /// The run with what is planted, and with each knob turned beside it, over all cores.
    pub fn predict_all(
        &mut self,
        planted: Option<Planted>,
    ) -> Result<(Prediction, Vec<Prediction>), DriveError> {
        loop {
            // What is left out is left out in all, so that their differences stay smooth.
            let (index, error) = match self.try_all(planted) {
                Ok(predictions) => return Ok(predictions),
                Err(failed) => failed,
            };
            let Some(stretch) = self.stretches.get_mut(index) else { return Err(error) };
            stretch.followed = match stretch.followed {
                Followed::Whole if stretch.read_later.is_some() => Followed::AfterJump,
                Followed::Whole | Followed::AfterJump if stretch.read_last.is_some() => Followed::No,
                _ => return Err(error),
            };
        }
    }

    fn try_all(
        &self,
        planted: Option<Planted>,
    ) -> Result<(Prediction, Vec<Prediction>), (usize, DriveError)> {
        let base = self.predict(planted, None)?;
        let next = AtomicUsize::new(0);
        let done = Mutex::new(Vec::new());
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(knob) = Knob::ALL.get(index) else { return };
                let prediction = self.predict(planted, Some((*knob, knob.step())));
                done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((index, prediction));
            }
        };
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        std::thread::scope(|scope| {
            for _ in 0..cores {
                scope.spawn(work);
            }
        });
        let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        done.sort_by_key(|(index, _)| *index);
        let turned = done.into_iter().map(|(_, prediction)| prediction).collect::<Result<Vec<_>, _>>()?;
        Ok((base, turned))
    }
}

/// The state as read later, the metal by the change that was read: offsets of its sensors stay out.
fn carried(state: State, first: Option<State>, later: State) -> State {
    let first = first.unwrap_or(State { tc_k: state.tc_k, tt_k: state.tt_k, ..later });
    let tc_k = state.tc_k + later.tc_k - first.tc_k;
    State { tc_k, inner_k: tc_k, tt_k: state.tt_k + later.tt_k - first.tt_k, ..later }
}

/// Ends of the integration's steps: fine after the jump, coarse where only metal moves.
fn nodes_s(stretch: &Stretch, start_s: f64) -> Vec<f64> {
    let mut nodes = Vec::new();
    let mut at_s = start_s;
    while at_s < stretch.end_s {
        let since_s = at_s - start_s;
        let step_s =
            STEPS_S.iter().find(|(until_s, _)| since_s < until_s - 1e-9).map_or(3.0, |(_, step_s)| *step_s);
        at_s += step_s;
        nodes.push(at_s);
    }
    nodes
}

/// Parts of a stretch in each of which the machine is one and the same: the whole of it, but for a machine that drifts.
fn parts(stretch: &Stretch, start_s: f64, planted: Option<Planted>) -> Vec<(f64, f64)> {
    let mut edges = vec![start_s];
    if let Some(Planted { course, .. }) = planted.filter(Planted::machine_changes) {
        let count = ((stretch.end_s - start_s) / PART_S).ceil().clamp(1.0, MOST_PARTS);
        edges.extend(
            (1..count as usize).map(|part| start_s + (stretch.end_s - start_s) * part as f64 / count),
        );
        let onset_s = course.onset_s - stretch.step.offset_s;
        // Not so close to an end that a part has no length.
        if (start_s + 0.1..stretch.end_s - 0.1).contains(&onset_s) {
            edges.push(onset_s);
        }
        edges.sort_by(f64::total_cmp);
        edges.dedup_by(|b, a| *b - *a < 0.05);
    }
    edges.push(stretch.end_s);
    edges.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// The state as read around a time.
fn read_state(recording: &Recording, t_s: f64) -> Option<State> {
    let mean = |channel: Channel| {
        let values = recording.series.get(&channel)?.slice(t_s - 0.5, t_s + 0.5).1;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (!values.is_empty() && mean.is_finite() && mean > 0.0).then_some(mean)
    };
    let speed_rpm = mean(Channel::ShaftSpeed)?;
    let (tc_k, tt_k) = (mean(Channel::Tc)?, mean(Channel::Tt)?);
    Some(State::new(rad_s_of_rpm(speed_rpm), mean(Channel::P2)?, tc_k, tt_k, mean(Channel::T2)?))
}

/// State at the start: as measured just before it, or at rest under the first inputs where nothing was recorded before.
fn start_state(
    run: usize,
    recording: &Recording,
    model: &Model,
    inputs: &RecordedInputs,
    start_s: f64,
) -> Result<State, DriftError> {
    let mean = |channel: Channel, from_s: f64, to_s: f64| {
        let values = recording.series.get(&channel)?.slice(from_s, to_s).1;
        (values.len() >= 5).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let before = |channel| mean(channel, start_s - BEFORE_S, start_s - 1e-6);
    let first = |channel| mean(channel, start_s, start_s + BEFORE_S);
    let boundary = inputs.at(start_s);
    let read = |channel, usual: f64| before(channel).or_else(|| first(channel)).unwrap_or(usual);
    let tc_k = read(Channel::Tc, 330.0);
    let tt_k = read(Channel::Tt, 600.0);
    let gas_k = read(Channel::T2, 350.0);
    let guess = State::new(
        rad_s_of_rpm(read(Channel::ShaftSpeed, 90e3).max(5e3)),
        read(Channel::P2, 1.3e5),
        tc_k,
        tt_k,
        gas_k,
    );
    if before(Channel::ShaftSpeed).is_some() && before(Channel::P2).is_some() {
        return Ok(guess);
    }
    let settled = settle(model, &boundary, guess).map_err(|source| DriftError::Drive { run, source })?;
    let has_metal =
        recording.series.contains_key(&Channel::Tc) && recording.series.contains_key(&Channel::Tt);
    Ok(if has_metal { State { tc_k, inner_k: tc_k, tt_k, ..settled } } else { settled })
}

/// Inputs with one of them turned, and the drift of a sensor taken off.
struct Turned<'a> {
    inputs: &'a RecordedInputs,
    turned: Option<(Knob, f64)>,
    planted: Option<Planted>,
    /// What is added to run time for the time of the campaign, s.
    offset_s: f64,
}

impl Inputs for Turned<'_> {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = self.inputs.at(t_s);
        if let Some((knob, by)) = self.turned {
            knob.shift(&mut boundary, by);
        }
        if let Some(planted) = self.planted {
            planted.undrift(&mut boundary, t_s + self.offset_s);
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.inputs.next_kink_s(t_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        !self.planted.is_some_and(|planted| planted.input_drifts()) && self.inputs.is_constant_after(t_s)
    }
}
