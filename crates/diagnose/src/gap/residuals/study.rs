//! One prepared recording: residual layout, whitening, and model predictions for any hypothesis.

use crate::gap::residuals::nuisance::{
    Circumstances, Nuisance, OUTPUTS, SHAPES, ShapedMap, apply, from_step, growing_from, nuisances,
    onset_step,
};
pub(crate) use crate::gap::residuals::nuisance::{EffectValues, Hypothesis, members};
use crate::gap::residuals::true_inputs::{
    Actuators, MachineRun, SurroundingsHistory, acts_on_machine, rested,
};
use mapper_core::{Channel, Recording, StepMarker};
use mapper_inference::hypotheses::TimeHistory;
use mapper_observe::averages::{Block, INPUT_CHANNELS, Schedule, Table, block_mean, blocks};
use mapper_observe::declared::Declared;
use mapper_observe::model_inputs::lagged_command::ramp_end_s;
use mapper_observe::model_inputs::smoothed_inputs::SmoothedInputs;
use mapper_observe::model_inputs::step_timing::{Times, with_command_times};
use mapper_physics::machine::params::Params;
use mapper_physics::rig::effect::{Effect, EffectError, EffectInfo, EffectParameter, NamedValues, Rig, add};
use mapper_physics::simulation::driven::{DriveError, FrozenGrid};
use mapper_physics::simulation::model::Model;
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Values of one output in one step with common noise.
#[derive(Debug, Clone)]
pub struct Group {
    /// Step, by its index in [`Study::steps`].
    pub step: usize,
    /// Output, by its index in [`OUTPUTS`].
    pub output: usize,
    /// Rows of the group in the vector of residuals.
    pub rows: std::ops::Range<usize>,
    /// Blocks of the values, by their index in the step.
    pub blocks: Vec<usize>,
}

/// One step with its blocks.
#[derive(Debug, Clone)]
pub struct StudyStep {
    /// As recorded.
    pub marker: StepMarker,
    /// Whether P3 or valve jumped at its start.
    pub jumped: bool,
    /// Whether it begins with a ramp that is longer than a jump.
    pub ramped: bool,
    pub blocks: Vec<Block>,
}

/// Model prediction for a hypothesis.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Block means in the residuals' layout, in the channels' units.
    pub values: Vec<f64>,
    /// Their slopes, unit/s.
    pub slopes: Vec<f64>,
    pub(crate) run: Arc<MachineRun>,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum PredictError {
    #[error(transparent)]
    Drive(#[from] DriveError),
    #[error(transparent)]
    Effect(#[from] EffectError),
}

/// Step and block of a read of the model, and its share of the block's mean.
type BlockShare = (usize, usize, f64);

/// One prepared recording.
#[derive(Debug, Clone)]
pub struct Study {
    /// Declared tolerances and noise.
    pub declared: Declared,
    /// All samples.
    pub table: Table,
    /// Steps.
    pub steps: Vec<StudyStep>,
    /// The nominal rig.
    pub nominal: Rig,
    /// Candidate effects.
    pub effects: Vec<Arc<dyn Effect>>,
    /// When each effect acts.
    pub histories: Vec<TimeHistory>,
    /// Whether each effect changes the machine or its inputs, and not only sensors of its outputs.
    pub(crate) on_machine: Vec<bool>,
    /// Number of library effects; they are followed by candidates that begin with a step.
    pub catalogue: usize,
    /// Logarithm of the number of closure terms among which each was chosen, by the index of its effect.
    pub(crate) rarities: BTreeMap<usize, f64>,
    /// Nuisance parameters.
    pub nuisances: Vec<Nuisance>,
    /// Values of one output and step each.
    pub groups: Vec<Group>,
    /// Measured block means, in the layout of the groups.
    pub measured: Vec<f64>,
    /// The recorded inputs.
    pub inputs: SmoothedInputs,
    /// Recorded response of P3 and the valve to their commands.
    pub actuators: Actuators,
    /// Scatter of the sample times, s: it adds uncertainty to moving quantities.
    pub scatter_s: f64,
    pub(crate) rested: bool,
    pub(crate) grid: FrozenGrid,
    /// Times at which the model is evaluated: two per block, more in a ramp, and one at each jump.
    pub(crate) times_s: Vec<f64>,
    /// Step and block of each time, and its share of the block's mean; `None` at a jump.
    pub(crate) places: Vec<Option<BlockShare>>,
    pub(crate) rows: Vec<Vec<[Option<u32>; OUTPUTS.len()]>>,
    /// For each group the noise of the subtracted values, unit squared; empty if nothing was subtracted.
    pub(crate) other_noise: Vec<DMatrix<f64>>,
    pub(crate) surroundings: OnceLock<SurroundingsHistory>,
}

/// The first step counts from this time before the first jump, s. Bound: the rig's earlier history is unknown, and the
/// metal's start is fitted anyway.
const HOLD_S: f64 = 100.0;
/// Time after the last reading until which inputs are prepared, s. Bound: an interval of samples.
const AFTER_LAST_S: f64 = 0.1;

/// Blocks of phases in which only the metal temperature changes. Bound: a sixth of the time constant of a housing.
const SLOW: Schedule =
    Schedule { first_s: 0.0, lengths_s: &[(f64::INFINITY, 10.0)], shortest_s: 0.0, shortest_ratio: 0.5 };
/// Blocks after a jump. Bound: each a fraction of the time since the jump, so that no block averages over what still settles.
const AFTER_JUMP: Schedule = Schedule {
    lengths_s: &[(1.0, 0.2), (3.0, 0.5), (7.0, 2.0), (15.0, 4.0), (31.0, 8.0), (f64::INFINITY, 16.0)],
    ..SLOW
};
/// Blocks of a ramp. Bound: slow air and the shaft follow a ramp within seconds, and a block of a second averages over none of that.
const RAMP: Schedule = Schedule { lengths_s: &[(1.0, 0.2), (3.0, 0.5), (f64::INFINITY, 1.0)], ..SLOW };
/// Ramps up to this length count as jumps, s. Bound: until then the blocks after a jump are those of a ramp.
const SHORT_RAMP_S: f64 = 3.0;

/// Reads of a block of a ramp. Bound: an actuator turns its slope with each command, several times a second, which two points miss.
const READS_IN_RAMP: usize = 5;

/// Times at which the model is read for a block, s: their mean is that of the samples, and so is the spread of two.
fn times_of_block(block: &Block, in_ramp: bool) -> Vec<f64> {
    let Block { mean_s, spread_s, ref samples, .. } = *block;
    if spread_s == 0.0 {
        return vec![mean_s];
    }
    if !in_ramp {
        return vec![mean_s - spread_s, mean_s + spread_s];
    }
    let count = READS_IN_RAMP.min(samples.len());
    // Evenly spaced points from -1 to 1 have the spread sqrt((n + 1) / (3 (n - 1))).
    let farthest_s = spread_s / ((count + 1) as f64 / (3 * (count - 1)) as f64).sqrt();
    let place = |i: usize| mean_s + farthest_s * (2.0 * i as f64 / (count - 1) as f64 - 1.0);
    (0..count).map(place).collect()
}

fn blocks_of_ramp(table: &Table, (start_s, ramp_end_s, end_s): (f64, f64, f64)) -> Vec<Block> {
    let mut of_step = blocks(table, start_s, ramp_end_s.min(end_s), &RAMP);
    let after = blocks(table, ramp_end_s, end_s, &AFTER_JUMP);
    of_step.extend(after.into_iter().map(|block| Block { since_jump_s: block.mean_s - start_s, ..block }));
    of_step
}

/// An effect that the campaign declares in part, and perhaps too high: it may also take away what is declared.
#[derive(Debug)]
struct DeclaredInPart {
    info: EffectInfo,
    effect: Arc<dyn Effect>,
}

impl DeclaredInPart {
    /// The effect with its range down to what is declared; itself if nothing is.
    fn of(effect: Arc<dyn Effect>, declared: &Params) -> Arc<dyn Effect> {
        let declared = match effect.info().id.as_ref() {
            "humidity" => declared.compressor.humidity_kg_kg,
            "area_split" => declared.compressor.alpha_area_ratio,
            "inlet_preheat" => declared.compressor.inlet_conductance_w_k,
            "tip_diameter" => declared.t2_probe_diameter_m,
            "stem_conduction" => declared.t2_probe_stem_ratio,
            _ => 0.0,
        };
        let mut info = effect.info().clone();
        match &mut info.parameters[..] {
            [size] if declared > 0.0 => size.low -= declared,
            _ => return effect,
        }
        Arc::new(DeclaredInPart { info, effect })
    }
}

impl Effect for DeclaredInPart {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        self.effect.prepare(values, rig)
    }
}

impl Study {
    /// Compared channels, in the order of all outputs.
    pub const OUTPUTS: [Channel; OUTPUTS.len()] = OUTPUTS;

    /// Prepares a recording whose campaign declares the actuator response.
    pub fn new(
        recording: &Recording,
        table: Table,
        declared: Declared,
        model: Model,
        effects: Vec<Arc<dyn Effect>>,
    ) -> Study {
        let actuators = Actuators::of(&table, recording, (&declared, &model), true);
        Study::with_actuators(recording, table, declared, model, effects, actuators)
    }

    pub(crate) fn with_actuators(
        recording: &Recording,
        table: Table,
        declared: Declared,
        model: Model,
        effects: Vec<Arc<dyn Effect>>,
        actuators: Actuators,
    ) -> Study {
        let recording = &with_command_times(recording);
        let times = Times::read(&table, recording, actuators.p3, declared.noise_sigma(Channel::P3));
        let timed = times.timed(recording);
        let mut nominal = Rig::new(model);
        nominal.instruments.p3_lag_s = declared.tolerances.actuator_lag_s;
        let effects: Vec<Arc<dyn Effect>> =
            effects.into_iter().map(|effect| DeclaredInPart::of(effect, &nominal.model.params)).collect();
        let first_s = table.t_s.first().copied().unwrap_or(0.0);
        let steps: Vec<StudyStep> = recording
            .steps
            .iter()
            .enumerate()
            .map(|(index, marker)| {
                let jumped = index > 0;
                // Half a sample after the last one, which is the next step's first sample if steps are contiguous.
                let end_s = recording.steps.get(index + 1).map_or(marker.end_s, |next| next.start_s);
                let start_s =
                    if jumped { marker.start_s } else { marker.start_s.max(end_s - HOLD_S).max(first_s) };
                let ramp_end_s = ramp_end_s(recording, marker);
                let ramped = jumped && ramp_end_s - start_s > SHORT_RAMP_S;
                let blocks = if ramped {
                    blocks_of_ramp(&table, (start_s, ramp_end_s, end_s))
                } else {
                    blocks(&table, start_s, end_s, if jumped { &AFTER_JUMP } else { &SLOW })
                };
                StudyStep { marker: *marker, jumped, ramped, blocks }
            })
            .collect();
        let inputs = SmoothedInputs::read(&table, &timed, &declared, (actuators.p3, actuators.valve));
        let mut groups = Vec::new();
        let mut measured = Vec::new();
        let mut rows: Vec<Vec<[Option<u32>; OUTPUTS.len()]>> =
            steps.iter().map(|step| vec![[None; OUTPUTS.len()]; step.blocks.len()]).collect();
        for (step_index, step) in steps.iter().enumerate() {
            for (output, channel) in OUTPUTS.iter().enumerate() {
                // If no P3 response is declared, none is wrong.
                if *channel == Channel::P3 && !actuators.judged {
                    continue;
                }
                let Some(column) = table.column(*channel) else { continue };
                let start = measured.len();
                let mut of_group = Vec::new();
                for (block_index, block) in step.blocks.iter().enumerate() {
                    if let Some(mean) = block_mean(column, block) {
                        rows[step_index][block_index][output] = Some(measured.len() as u32);
                        measured.push(mean);
                        of_group.push(block_index);
                    }
                }
                if !of_group.is_empty() {
                    groups.push(Group {
                        step: step_index,
                        output,
                        rows: start..measured.len(),
                        blocks: of_group,
                    });
                }
            }
        }
        let mut reads: Vec<(f64, Option<BlockShare>)> = Vec::new();
        for (step_index, (step, marker)) in steps.iter().zip(&recording.steps).enumerate() {
            if step.jumped {
                reads.push((times.starts_s[step_index], None));
            }
            let ramp_end_s = if step.ramped { ramp_end_s(recording, marker) } else { f64::NEG_INFINITY };
            for (block_index, block) in step.blocks.iter().enumerate() {
                let times_s = times_of_block(block, block.mean_s < ramp_end_s);
                let place = Some((step_index, block_index, 1.0 / times_s.len() as f64));
                reads.extend(times_s.into_iter().map(|t_s| (t_s, place)));
            }
        }
        reads.sort_by(|a, b| a.0.total_cmp(&b.0));
        let start_s = reads.first().map_or(first_s, |(t_s, _)| *t_s) - 0.5;
        let end_s = reads.last().map_or(start_s + 1.0, |(t_s, _)| t_s + AFTER_LAST_S);
        let jumps = times.starts_s.iter().zip(&steps).filter(|(_, step)| step.jumped);
        let jumps_s: Vec<f64> = jumps
            .flat_map(|(start_s, step)| {
                let end_s = step.ramped.then(|| ramp_end_s(recording, &step.marker).max(*start_s));
                std::iter::once(*start_s).chain(end_s)
            })
            .collect();
        let (times_s, places): (Vec<f64>, Vec<_>) = reads.into_iter().unzip();
        Study {
            nuisances: nuisances(&declared),
            histories: vec![TimeHistory::THROUGHOUT; effects.len()],
            on_machine: effects.iter().map(|effect| acts_on_machine(&nominal, effect.as_ref())).collect(),
            catalogue: effects.len(),
            rarities: BTreeMap::new(),
            actuators,
            scatter_s: times.scatter_s,
            rested: rested(&table, start_s),
            grid: FrozenGrid::new(start_s, end_s, &jumps_s, &times_s),
            declared,
            table,
            steps,
            nominal,
            effects,
            groups,
            measured,
            inputs,
            times_s,
            places,
            rows,
            other_noise: Vec::new(),
            surroundings: OnceLock::new(),
        }
    }

    /// Start and end of the part of the recording that the model follows, s.
    pub(crate) fn followed_s(&self) -> (f64, f64) {
        let nodes_s = self.grid.nodes_s();
        (nodes_s.first().copied().unwrap_or(0.0), nodes_s.last().copied().unwrap_or(0.0))
    }

    /// The null hypothesis.
    pub fn nothing(&self) -> Hypothesis {
        Hypothesis { nuisances: vec![0.0; self.nuisances.len()], effects: Vec::new() }
    }

    pub(crate) fn rig(
        &self,
        hypothesis: &Hypothesis,
        step: usize,
    ) -> Result<(Rig, Circumstances), EffectError> {
        let mut rig = self.nominal.clone();
        let mut circumstances = Circumstances::default();
        for (index, values) in &hypothesis.effects {
            let share = self.histories[*index].at(step as f64);
            if share == 1.0 {
                add(&mut rig, self.effects[*index].as_ref(), values)?;
            } else if share > 0.0 {
                let parameters = &self.effects[*index].info().parameters;
                let grown = |(p, value): (&EffectParameter, &f64)| p.neutral + share * (value - p.neutral);
                let values: Vec<f64> = parameters.iter().zip(values).map(grown).collect();
                add(&mut rig, self.effects[*index].as_ref(), &values)?;
            }
        }
        for (nuisance, sigmas) in self.nuisances.iter().zip(&hypothesis.nuisances) {
            apply(&self.declared, nuisance.kind, nuisance.value(*sigmas), &mut rig, &mut circumstances);
        }
        if circumstances.shape != [0.0; SHAPES] {
            rig.model.map =
                Arc::new(ShapedMap { inner: rig.model.map.clone(), coefficients: circumstances.shape });
        }
        circumstances.paths = INPUT_CHANNELS.map(|channel| *rig.instruments.path(channel));
        circumstances.valve = rig.instruments.valve;
        Ok((rig, circumstances))
    }

    /// Offset of a channel under a hypothesis at the end of the recording, in its unit.
    pub(crate) fn offset_at_end(&self, hypothesis: &Hypothesis, channel: Channel) -> Option<f64> {
        let last = self.steps.len().checked_sub(1)?;
        Some(self.rig(hypothesis, last).ok()?.0.instruments.path(channel).offset)
    }

    /// Slopes of predicted values, from block to block.
    pub(crate) fn slopes(&self, values: &[f64]) -> Vec<f64> {
        let mut slopes = vec![0.0; values.len()];
        for group in &self.groups {
            let time = |i: usize| self.steps[group.step].blocks[group.blocks[i]].mean_s;
            let last = group.blocks.len() - 1;
            for (i, row) in group.rows.clone().enumerate() {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
                if before < after {
                    let rise = values[group.rows.start + after] - values[group.rows.start + before];
                    slopes[row] = rise / (time(after) - time(before));
                }
            }
        }
        slopes
    }
}

impl Study {
    /// Adds an effect that is not in the library and acts throughout. Returns its index.
    pub fn add(&mut self, effect: Arc<dyn Effect>) -> usize {
        self.on_machine.push(acts_on_machine(&self.nominal, effect.as_ref()));
        self.effects.push(effect);
        self.histories.push(TimeHistory::THROUGHOUT);
        self.effects.len() - 1
    }

    /// Adds candidates for every library effect beginning with a step after the first, or growing from it.
    pub(crate) fn add_onsets(&mut self) {
        let last = self.steps.len().saturating_sub(1);
        for effect in 0..self.catalogue {
            // Growth over a single step equals an onset there.
            let histories = (1..=last)
                .map(from_step)
                .chain((1..last).map(|first| growing_from(first, self.steps.len())))
                .collect::<Vec<_>>();
            for history in histories {
                self.effects.push(self.effects[effect].clone());
                self.on_machine.push(self.on_machine[effect]);
                self.histories.push(history);
            }
        }
    }

    /// Candidates with an onset of one library effect.
    pub(crate) fn onsets_of(&self, effect: usize) -> impl Iterator<Item = usize> {
        let is_one = move |index: &usize| {
            onset_step(self.histories[*index]).is_some()
                && Arc::ptr_eq(&self.effects[*index], &self.effects[effect])
        };
        (self.catalogue..self.effects.len()).filter(is_one)
    }

    /// The library effect behind a candidate with any onset; the candidate itself if it is not in the library.
    pub(crate) fn family(&self, index: usize) -> usize {
        let same = |known: &usize| Arc::ptr_eq(&self.effects[*known], &self.effects[index]);
        (0..self.catalogue).find(same).unwrap_or(index)
    }

    /// Keeps only these rows; `keep` uses the layout of the residuals.
    pub(crate) fn with_rows(mut self, keep: &[bool]) -> Study {
        let (mut groups, mut measured) = (Vec::new(), Vec::new());
        for of_step in &mut self.rows {
            of_step.fill([None; OUTPUTS.len()]);
        }
        for group in &self.groups {
            let start = measured.len();
            let mut blocks = Vec::new();
            for (row, block) in group.rows.clone().zip(&group.blocks).filter(|(row, _)| keep[*row]) {
                self.rows[group.step][*block][group.output] = Some(measured.len() as u32);
                measured.push(self.measured[row]);
                blocks.push(*block);
            }
            if !blocks.is_empty() {
                groups.push(Group { rows: start..measured.len(), blocks, ..*group });
            }
        }
        (self.groups, self.measured) = (groups, measured);
        self
    }
}
