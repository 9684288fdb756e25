//! Runs the nominal model through whole runs, and computes the sensitivity of its readings to each perturbation.

use crate::drift::causes::planted::Planted;
use crate::drift::runs::request::DriftError;
use crate::drift::runs::time_axis::{Block, CampaignStep};
use crate::drift::sensitivity::knobs::{KNOBS, difference_step};
use crate::drift::sensitivity::segment::{Followed, LEFT_OUT_S, Place, Stretch, carried, read_state};
use mapper_core::{Channel, Recording};
use mapper_numerics::parallel;
use mapper_observe::averages::mean_reading::{BEFORE_S, mean_between};
use mapper_observe::channels::OUTPUTS;
use mapper_observe::initial_state::estimate_state;
use mapper_observe::model_inputs::averaged_inputs::AveragedInputs;
use mapper_observe::perturbation::{Perturbation, ShiftedInputs};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::instruments::true_value;
use mapper_physics::simulation::driven::{DriveError, FrozenGrid, drive, settle};
use mapper_physics::simulation::inputs::Inputs;
use mapper_physics::simulation::model::{Model, State};

/// Interval of model readings within a segment, s.
const SAMPLE_S: f64 = 2.5;
/// Time before the start over which readings give the initial state, s.
const BEFORE_START_S: f64 = 2.0;

/// Model predictions for one run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prediction {
    /// Means over the segments, [`OUTPUTS`] in each.
    pub means: Vec<[f64; OUTPUTS.len()]>,
    /// Highest position on the speed line within each segment; 1 is the surge line.
    pub surge_position_ratio: Vec<f64>,
    /// Efficiency and heat-transfer coefficient, W/(m2 K), at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
}

impl Prediction {
    /// Appends the prediction of the next run.
    fn append(&mut self, next: Prediction) {
        self.means.extend(next.means);
        self.surge_position_ratio.extend(next.surge_position_ratio);
        self.step_ends.extend(next.step_ends);
    }
}

/// One run, ready to be driven.
pub(crate) struct Drive<'a> {
    model: &'a Model,
    inputs: AveragedInputs,
    start: State,
    stretches: Vec<Stretch>,
    blocks: usize,
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
        let of_run: Vec<(usize, &CampaignStep)> =
            steps.iter().enumerate().filter(|(_, step)| step.run == run).collect();
        let (Some((_, first)), Some((_, last))) = (of_run.first(), of_run.last()) else {
            return Err(DriftError::NoSteps { run });
        };
        let jumps: Vec<(f64, f64)> =
            of_run.iter().map(|(_, step)| (step.start_s, step.valve_opening_ratio)).collect();
        let inputs = AveragedInputs::read(recording, nominal, &jumps, last.end_s)
            .map_err(|source| DriftError::Inputs { run, source })?;
        let start = start_state(run, recording, model, &inputs, first.start_s)?;
        let mut block_count = 0;
        let mut stretches = Vec::new();
        for (position, step) in &of_run {
            let mut stretch = Stretch {
                step: **step,
                start_s: step.start_s,
                end_s: step.end_s,
                read_first: read_state(recording, nominal, step.start_s - 0.6),
                read_later: read_state(recording, nominal, step.start_s + LEFT_OUT_S),
                read_last: read_state(recording, nominal, step.end_s - 1.0),
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

    /// The run with at most one perturbation, in addition to the planted drift. An error names the segment that the model could not follow.
    fn predict(
        &self,
        planted: &[Planted],
        turned: Option<(Perturbation, f64)>,
    ) -> Result<Prediction, (usize, DriveError)> {
        let mut state = self.start;
        if let Some((knob, by)) = turned {
            knob.start(&mut state, by);
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
            let inputs = Undrifted {
                inputs: ShiftedInputs { inputs: &self.inputs, shifts: turned.as_slice() },
                planted,
                offset_s,
            };
            let nodes = stretch.nodes_s(start_s);
            for (from_s, to_s) in stretch.parts(start_s, planted) {
                let mut model = self.model.clone();
                if let Some((knob, by)) = turned {
                    knob.turn(&mut model.params, by);
                }
                for planted in planted {
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
            // A segment that was not followed has no prediction.
            means.iter_mut().for_each(|sum| *sum /= count as f64);
        }
        Ok(prediction)
    }

    /// The run with the planted drift, and with each perturbation added to it, over all cores.
    pub fn predict_all(&mut self, planted: &[Planted]) -> Result<(Prediction, Vec<Prediction>), DriveError> {
        loop {
            // Segments left out of one run are left out of all, so that their differences stay smooth.
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

    fn try_all(&self, planted: &[Planted]) -> Result<(Prediction, Vec<Prediction>), (usize, DriveError)> {
        let base = self.predict(planted, None)?;
        let turned =
            parallel::map(&KNOBS, |knob| self.predict(planted, Some((*knob, difference_step(*knob)))));
        let turned = turned.into_iter().collect::<Result<_, _>>()?;
        Ok((base, turned))
    }
}

/// Model predictions of all runs with the planted drift, and with each perturbation added to it.
pub(crate) fn predict(
    drives: &mut [Drive<'_>],
    planted: &[Planted],
) -> Result<(Prediction, Vec<Prediction>), DriftError> {
    let mut base = Prediction::default();
    let mut turned = vec![Prediction::default(); KNOBS.len()];
    for (run, drive) in drives.iter_mut().enumerate() {
        let (own_base, own_turned) =
            drive.predict_all(planted).map_err(|source| DriftError::Drive { run, source })?;
        base.append(own_base);
        turned.iter_mut().zip(own_turned).for_each(|(all, own)| all.append(own));
    }
    Ok((base, turned))
}

/// State at the start: as measured just before it, or steady under the first inputs without earlier readings.
fn start_state(
    run: usize,
    recording: &Recording,
    model: &Model,
    inputs: &AveragedInputs,
    start_s: f64,
) -> Result<State, DriftError> {
    let before = |channel| mean_between(recording, channel, start_s - BEFORE_START_S, start_s, 5);
    let first = |channel| mean_between(recording, channel, start_s, start_s + BEFORE_START_S + BEFORE_S, 5);
    let read = |channel| before(channel).or_else(|| first(channel));
    let boundary = inputs.at(start_s);
    let guess = estimate_state(&boundary, read);
    if before(Channel::ShaftSpeed).is_some() && before(Channel::P2).is_some() {
        return Ok(guess);
    }
    let settled = settle(model, &boundary, guess).map_err(|source| DriftError::Drive { run, source })?;
    let metal = [Channel::Tc, Channel::Tt].map(|channel| recording.series.contains_key(&channel));
    let State { tc_k, tt_k, .. } = guess;
    Ok(if metal == [true; 2] { State { tc_k, inner_k: tc_k, tt_k, ..settled } } else { settled })
}

/// Inputs with the drift of a sensor subtracted.
struct Undrifted<'a> {
    inputs: ShiftedInputs<'a, AveragedInputs>,
    planted: &'a [Planted],
    /// Offset from run time to campaign time, s.
    offset_s: f64,
}

impl Inputs for Undrifted<'_> {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = self.inputs.at(t_s);
        for planted in self.planted {
            planted.undrift(&mut boundary, t_s + self.offset_s);
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.inputs.next_kink_s(t_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        !self.planted.iter().any(Planted::input_drifts) && self.inputs.is_constant_after(t_s)
    }
}
