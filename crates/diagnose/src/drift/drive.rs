//! Drives the model through a run, with its drifts and perturbations.

use crate::drift::causes::Drift;
use crate::drift::runs::{CampaignStep, DriftError, DriftRequest, SEGMENTS, Segment};
use mapper_core::{Channel, Dimension, Recording};
use mapper_numerics::parallel;
use mapper_observe::averages::{BEFORE_S, OUTPUTS, estimate_state, mean_between};
use mapper_observe::model_inputs::averaged_inputs::AveragedInputs;
use mapper_observe::model_inputs::lagged_command::Response;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::instruments::true_value;
use mapper_physics::simulation::driven::{DriveError, FrozenGrid, drive, settle};
use mapper_physics::simulation::model::{Model, State};
use mapper_physics::simulation::steady::Inputs;

/// Interval of model readings within a segment, s. Bound: four in the shortest segment; housings hardly move within it.
const SAMPLE_S: f64 = 2.5;
/// Time before a jump around which the state before it is read, s. Bound: a window of a second must end before the jump.
const BEFORE_JUMP_S: f64 = 0.6;
/// Time before the end of a step at which the model is read, s. Bound: shorter than any sample, longer than rounding.
const BEFORE_END_S: f64 = 1e-3;
/// Shortest part of a step with a constant machine, s. Bound: a sample.
const MIN_PART_S: f64 = 0.1;
/// Difference of times that count as one, s. Bound: half a sample.
const SAME_TIME_S: f64 = 0.05;
/// Size of a perturbation of a pressure, Pa. Bound: small enough for curvature, large enough for rounding errors.
const PRESSURE_STEP_PA: f64 = 100.0;
/// Size of a perturbation of a temperature, K. Bound: as above.
const TEMPERATURE_STEP_K: f64 = 0.5;
/// Size of a perturbation of the friction, W s2/rad2. Bound: as above.
const FRICTION_STEP_W_S2_RAD2: f64 = 5e-8;
/// Size of a relative perturbation. Bound: as above.
const RELATIVE_STEP_RATIO: f64 = 2e-3;

/// Model predictions for one run, or for all.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prediction {
    /// Means of [`OUTPUTS`] over the segments.
    pub means: Vec<[f64; OUTPUTS.len()]>,
    /// Highest position on the speed line within each segment; 1 is the surge line.
    pub surge_position_ratio: Vec<f64>,
    /// Efficiency and heat-transfer coefficient, W/(m2 K), at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
}

impl Prediction {
    fn append(&mut self, next: Prediction) {
        self.means.extend(next.means);
        self.surge_position_ratio.extend(next.surge_position_ratio);
        self.step_ends.extend(next.step_ends);
    }
}

/// The model of one run with its inputs.
pub(crate) struct Drive<'a> {
    model: &'a Model,
    inputs: AveragedInputs,
    start: State,
    steps: Vec<DrivenStep>,
    segment_count: usize,
}

impl<'a> Drive<'a> {
    /// Prepares run `run`; `steps` and `segments` are those of the whole campaign.
    pub(super) fn new(
        run: usize,
        recording: &Recording,
        request: &DriftRequest<'a>,
        steps: &[CampaignStep],
        segments: &[Segment],
    ) -> Result<Self, DriftError> {
        let of_run: Vec<(usize, &CampaignStep)> =
            steps.iter().enumerate().filter(|(_, step)| step.run == run).collect();
        let Some((_, first)) = of_run.first() else {
            return Err(DriftError::NoSteps { run });
        };
        let (model, nominal) = (request.model, &request.boundary);
        let valve = Response::of_valve(request.actuators.as_ref());
        let inputs = AveragedInputs::read(recording, (nominal, valve), &recording.steps)
            .map_err(|source| DriftError::Inputs { run, source })?;
        let before_s = request.identification.thresholds.end_mean_s;
        let start = start_state((run, recording), model, &inputs, first.start_s, before_s)?;
        let mut segment_count = 0;
        let mut driven_steps = Vec::new();
        for (position, step) in &of_run {
            let mut driven = DrivenStep {
                step: **step,
                start_s: step.start_s,
                end_s: step.end_s,
                segments_s: Vec::new(),
                before_jump: measured_state(recording, nominal, step.start_s - BEFORE_JUMP_S),
                after_jump: measured_state(recording, nominal, step.start_s + SKIPPED_S),
                at_end: measured_state(recording, nominal, step.end_s - 1.0),
                coverage: Coverage::Whole,
                times_s: Vec::new(),
                targets: Vec::new(),
            };
            for segment in segments.iter().filter(|segment| segment.step == *position) {
                let count = (segment.length_s() / SAMPLE_S).round().max(1.0) as usize;
                for index in 0..count {
                    let share = (index as f64 + 0.5) / count as f64;
                    driven.times_s.push(segment.start_s + share * segment.length_s());
                    driven.targets.push(Target::Segment(segment_count));
                }
                driven.segments_s.push(segment.start_s);
                segment_count += 1;
            }
            driven.times_s.push(step.end_s - BEFORE_END_S);
            driven.targets.push(Target::StepEnd);
            driven_steps.push(driven);
        }
        Ok(Drive { model, inputs, start, steps: driven_steps, segment_count })
    }

    /// The run with drifts and at most one perturbation. An error has the position of the step that the model could not follow.
    fn predict(
        &self,
        drifts: &[Drift],
        perturbed: Option<(Perturbation, f64)>,
    ) -> Result<Prediction, (usize, DriveError)> {
        let mut state = self.start;
        if let Some((perturbation, by)) = perturbed {
            perturbation.adjust_initial_state(&mut state, by);
        }
        let mut prediction = Prediction {
            means: vec![[0.0; OUTPUTS.len()]; self.segment_count],
            surge_position_ratio: vec![f64::NEG_INFINITY; self.segment_count],
            step_ends: vec![(f64::NAN, f64::NAN); self.steps.len()],
        };
        let mut counts = vec![0_usize; self.segment_count];
        for (index, step) in self.steps.iter().enumerate() {
            let mut start_s = step.start_s;
            match (step.coverage, step.after_jump, step.at_end) {
                (Coverage::AfterJump, Some(measured), _) => {
                    start_s += SKIPPED_S;
                    state = state_after(state, step.before_jump, measured);
                }
                (Coverage::None, _, Some(measured)) => {
                    state = state_after(state, step.before_jump, measured);
                    continue;
                }
                _ => {}
            }
            let offset_s = step.step.offset_s;
            let inputs = DriftFreeInputs { recorded: &self.inputs, perturbed, drifts, offset_s };
            for (from_s, to_s) in step.parts(start_s, drifts) {
                let mut model = self.model.clone();
                if let Some((perturbation, by)) = perturbed {
                    perturbation.adjust_machine(&mut model.params, by);
                }
                for drift in drifts {
                    drift.apply_to(&mut model.params, from_s + offset_s, to_s + offset_s);
                }
                let before = step.times_s.partition_point(|t_s| *t_s < from_s);
                let times_s = &step.times_s[before..];
                let times_s = &times_s[..times_s.partition_point(|t_s| *t_s < to_s)];
                let grid = FrozenGrid::new(from_s, to_s, &[start_s], times_s);
                let step_ends = &mut prediction.step_ends;
                let (means, highest) = (&mut prediction.means, &mut prediction.surge_position_ratio);
                state = drive(&model, &inputs, state, &grid, times_s, |reading, prepared, state, outputs| {
                    match step.targets[before + reading] {
                        Target::StepEnd => step_ends[index] = (outputs.efficiency, outputs.h_w_m2k),
                        Target::Segment(segment) => {
                            for (sum, channel) in means[segment].iter_mut().zip(OUTPUTS) {
                                *sum += true_value(channel, prepared, state, outputs).unwrap_or(f64::NAN);
                            }
                            highest[segment] = highest[segment].max(outputs.surge_position_ratio);
                            counts[segment] += 1;
                        }
                    }
                })
                .map_err(|error| (index, error))?;
            }
        }
        for (means, count) in prediction.means.iter_mut().zip(counts) {
            // A segment that the model did not follow becomes NaN.
            means.iter_mut().for_each(|sum| *sum /= count as f64);
        }
        Ok(prediction)
    }

    /// The run with drifts, and with each of [`PERTURBATIONS`] in addition.
    fn predict_all(&mut self, drifts: &[Drift]) -> Result<(Prediction, Vec<Prediction>), DriveError> {
        loop {
            // A part that one of these runs cannot follow is left out of all, so that their differences stay smooth.
            let (index, error) = match self.try_all(drifts) {
                Ok(predictions) => return Ok(predictions),
                Err(failed) => failed,
            };
            let Some(step) = self.steps.get_mut(index) else { return Err(error) };
            step.coverage = match step.coverage {
                Coverage::Whole if step.after_jump.is_some() => Coverage::AfterJump,
                Coverage::Whole | Coverage::AfterJump if step.at_end.is_some() => Coverage::None,
                _ => return Err(error),
            };
        }
    }

    fn try_all(&self, drifts: &[Drift]) -> Result<(Prediction, Vec<Prediction>), (usize, DriveError)> {
        let base = self.predict(drifts, None)?;
        let perturbed = parallel::map(&PERTURBATIONS, |perturbation| {
            self.predict(drifts, Some((*perturbation, difference_step(*perturbation))))
        });
        Ok((base, perturbed.into_iter().collect::<Result<_, _>>()?))
    }
}

/// Model predictions of all runs with drifts, and with each of [`PERTURBATIONS`] in addition.
pub(crate) fn predict(
    drives: &mut [Drive<'_>],
    drifts: &[Drift],
) -> Result<(Prediction, Vec<Prediction>), DriftError> {
    let mut base = Prediction::default();
    let mut perturbed = vec![Prediction::default(); PERTURBATIONS.len()];
    for (run, drive) in drives.iter_mut().enumerate() {
        let (own_base, own_perturbed) =
            drive.predict_all(drifts).map_err(|source| DriftError::Drive { run, source })?;
        base.append(own_base);
        perturbed.iter_mut().zip(own_perturbed).for_each(|(all, own)| all.append(own));
    }
    Ok((base, perturbed))
}

/// State at the start: as measured in `before_s` seconds before it; without such readings, steady under the first inputs.
fn start_state(
    (run, recording): (usize, &Recording),
    model: &Model,
    inputs: &AveragedInputs,
    start_s: f64,
    before_s: f64,
) -> Result<State, DriftError> {
    let before = |channel| mean_between(recording, channel, start_s - before_s, start_s, 5);
    let first = |channel| mean_between(recording, channel, start_s, start_s + before_s + BEFORE_S, 5);
    let read = |channel| before(channel).or_else(|| first(channel));
    let boundary = inputs.at(start_s);
    let guess = estimate_state(&boundary, read);
    if before(Channel::ShaftSpeed).is_some() && before(Channel::P2).is_some() {
        return Ok(guess);
    }
    let settled = settle(model, &boundary, guess).map_err(|source| DriftError::Drive { run, source })?;
    let is_metal_measured =
        [Channel::Tc, Channel::Tt].iter().all(|channel| recording.series.contains_key(channel));
    let State { tc_k, tt_k, .. } = guess;
    Ok(if is_metal_measured { State { tc_k, inner_k: tc_k, tt_k, ..settled } } else { settled })
}

/// Inputs without the drift of their sensors, with at most one perturbation.
struct DriftFreeInputs<'a> {
    recorded: &'a AveragedInputs,
    perturbed: Option<(Perturbation, f64)>,
    drifts: &'a [Drift],
    /// Offset from run time to campaign time, s.
    offset_s: f64,
}

impl Inputs for DriftFreeInputs<'_> {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = self.recorded.at(t_s);
        if let Some((perturbation, by)) = self.perturbed {
            perturbation.adjust_boundary(&mut boundary, by);
        }
        for drift in self.drifts {
            drift.subtract_from(&mut boundary, t_s + self.offset_s);
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.recorded.next_kink_s(t_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        !self.drifts.iter().any(Drift::acts_on_inputs) && self.recorded.is_constant_after(t_s)
    }
}

/// Time after a jump that is left out if the model cannot follow the jump (deep beyond the surge line), s. Shaft and outlet then start from their
/// readings, the metal from the change of its readings.
pub(crate) const SKIPPED_S: f64 = SEGMENTS.first_s;

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
            if (start_s + MIN_PART_S..self.end_s - MIN_PART_S).contains(&onset_s) {
                edges.push(onset_s);
            }
            edges.sort_by(f64::total_cmp);
            edges.dedup_by(|b, a| *b - *a < SAME_TIME_S);
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

/// The state after a skipped part: `measured`, with the metal of `state` plus its measured change since `before`: sensor offsets cancel.
pub(crate) fn state_after(state: State, before: Option<State>, measured: State) -> State {
    let before = before.unwrap_or(State { tc_k: state.tc_k, tt_k: state.tt_k, ..measured });
    let tc_k = state.tc_k + measured.tc_k - before.tc_k;
    State { tc_k, inner_k: tc_k, tt_k: state.tt_k + measured.tt_k - before.tt_k, ..measured }
}

pub(crate) const PERTURBATIONS: [Perturbation; 19] = [
    Perturbation::Input(Channel::T1),
    Perturbation::Input(Channel::P1),
    Perturbation::Input(Channel::P3),
    Perturbation::Input(Channel::T3),
    Perturbation::Input(Channel::P4),
    Perturbation::Input(Channel::TOil),
    Perturbation::Ambient,
    Perturbation::Efficiency,
    Perturbation::Flow,
    Perturbation::TurbineEfficiency,
    Perturbation::TurbineFlow,
    Perturbation::ValveArea,
    Perturbation::CompressorConvection,
    Perturbation::TurbineConvection,
    Perturbation::ExternalConvection,
    Perturbation::OilConductance,
    Perturbation::Friction,
    Perturbation::StartTc,
    Perturbation::StartTt,
];

/// Size of a perturbation, in its unit.
pub(crate) fn difference_step(perturbation: Perturbation) -> f64 {
    match perturbation {
        Perturbation::Input(channel) if channel.info().dimension == Dimension::Pressure => PRESSURE_STEP_PA,
        Perturbation::Input(_) | Perturbation::Ambient | Perturbation::StartTc | Perturbation::StartTt => {
            TEMPERATURE_STEP_K
        }
        Perturbation::Friction => FRICTION_STEP_W_S2_RAD2,
        _ => RELATIVE_STEP_RATIO,
    }
}
