//! The nominal model through a whole run, and how its readings answer to each knob.

use crate::DriftError;
use crate::blocks::{Block, CampaignStep, OUTPUTS};
use crate::inputs::{self, RecordedInputs};
use crate::knob::Knob;
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
/// Where the usual grid fails, on the surge line, steps are as short as the first for as long as the second, s.
const FINE_S: (f64, f64) = (0.02, 4.0);
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
    grid: FrozenGrid,
    jumps_s: Vec<f64>,
    span_s: (f64, f64),
    /// Times at which the model is read, and where each reading belongs.
    times_s: Vec<f64>,
    places: Vec<Place>,
    blocks: usize,
    steps: usize,
}

#[derive(Debug, Clone, Copy)]
enum Place {
    Block(usize),
    StepEnd(usize),
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
        let of_run: Vec<&CampaignStep> = steps.iter().filter(|step| step.run == run).collect();
        let (Some(first), Some(last)) = (of_run.first(), of_run.last()) else {
            return Err(unusable("it has no steps; commands that change make steps".to_owned()));
        };
        let (start_s, end_s) = (first.start_s, last.end_s);
        let jumps_s: Vec<f64> = of_run.iter().map(|step| step.start_s).collect();
        let inputs = inputs::recorded(recording, nominal, start_s, end_s, &jumps_s)
            .map_err(|error| unusable(format!("its inputs cannot be used: {error}")))?;
        let start = start_state(run, recording, model, &inputs, start_s)?;

        let mut readings: Vec<(f64, Place)> = Vec::new();
        let own = blocks.iter().filter(|block| steps.get(block.step).is_some_and(|step| step.run == run));
        let mut block_count = 0;
        for (position, block) in own.enumerate() {
            let count = (block.length_s() / SAMPLE_S).round().max(1.0) as usize;
            for index in 0..count {
                let share = (index as f64 + 0.5) / count as f64;
                readings.push((block.start_s + share * block.length_s(), Place::Block(position)));
            }
            block_count += 1;
        }
        for (position, step) in of_run.iter().enumerate() {
            readings.push((step.end_s - 1e-3, Place::StepEnd(position)));
        }
        readings.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The first step's start is no jump for the model: it starts there.
        let grid = FrozenGrid::new(start_s, end_s, &jumps_s, &[]);
        Ok(Drive {
            model,
            inputs,
            start,
            grid,
            jumps_s,
            span_s: (start_s, end_s),
            times_s: readings.iter().map(|reading| reading.0).collect(),
            places: readings.iter().map(|reading| reading.1).collect(),
            blocks: block_count,
            steps: of_run.len(),
        })
    }

    /// The run with one knob turned, or none.
    pub fn predict(&self, turned: Option<(Knob, f64)>) -> Result<Prediction, DriveError> {
        let mut model = self.model.clone();
        let mut start = self.start;
        if let Some((knob, by)) = turned {
            knob.turn(&mut model.params, by);
            match knob {
                Knob::InitialTc => {
                    start.tc_k += by;
                    start.inner_k += by;
                }
                Knob::InitialTt => start.tt_k += by,
                _ => {}
            }
        }
        let inputs = Turned { inputs: &self.inputs, turned };
        let mut prediction = Prediction {
            means: vec![[0.0; OUTPUTS.len()]; self.blocks],
            surge_position_ratio: vec![f64::NEG_INFINITY; self.blocks],
            step_ends: vec![(f64::NAN, f64::NAN); self.steps],
        };
        let mut counts = vec![0_usize; self.blocks];
        drive(
            &model,
            &inputs,
            start,
            &self.grid,
            &self.times_s,
            |index, prepared, state, outputs| match self.places[index] {
                Place::StepEnd(step) => prediction.step_ends[step] = (outputs.efficiency, outputs.h_w_m2k),
                Place::Block(block) => {
                    for (sum, channel) in prediction.means[block].iter_mut().zip(OUTPUTS) {
                        *sum += true_value(channel, prepared, state, outputs).unwrap_or(f64::NAN);
                    }
                    let highest = &mut prediction.surge_position_ratio[block];
                    *highest = highest.max(outputs.surge_position_ratio);
                    counts[block] += 1;
                }
            },
        )?;
        for (means, count) in prediction.means.iter_mut().zip(counts) {
            means.iter_mut().for_each(|sum| *sum /= count.max(1) as f64);
        }
        Ok(prediction)
    }

    /// The run as it is, and with each knob turned, over all cores.
    pub fn predict_all(&mut self) -> Result<(Prediction, Vec<Prediction>), DriveError> {
        self.try_all().or_else(|_| {
            let (step_s, until_s) = FINE_S;
            let fine = |jump_s: &f64| {
                let jump_s = *jump_s;
                let count = (until_s / step_s).round() as usize;
                (1..=count).map(move |index| jump_s + step_s * index as f64)
            };
            let nodes_s: Vec<f64> = self.jumps_s.iter().flat_map(fine).collect();
            self.grid = FrozenGrid::new(self.span_s.0, self.span_s.1, &self.jumps_s, &nodes_s);
            self.try_all()
        })
    }

    fn try_all(&self) -> Result<(Prediction, Vec<Prediction>), DriveError> {
        let next = AtomicUsize::new(0);
        let done = Mutex::new(Vec::new());
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index > Knob::ALL.len() {
                    return;
                }
                let turned = index.checked_sub(1).map(|index| (Knob::ALL[index], Knob::ALL[index].step()));
                let prediction = self.predict(turned);
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
        let mut predictions =
            done.into_iter().map(|(_, prediction)| prediction).collect::<Result<Vec<_>, _>>()?.into_iter();
        let Some(base) = predictions.next() else { return Err(DriveError { t_s: f64::NAN }) };
        Ok((base, predictions.collect()))
    }
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

/// Inputs with one of them turned.
struct Turned<'a> {
    inputs: &'a RecordedInputs,
    turned: Option<(Knob, f64)>,
}

impl Inputs for Turned<'_> {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = self.inputs.at(t_s);
        if let Some((knob, by)) = self.turned {
            knob.shift(&mut boundary, by);
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.inputs.next_kink_s(t_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.inputs.is_constant_after(t_s)
    }
}
