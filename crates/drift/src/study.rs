//! From recordings to the answer.

use crate::blocks::{self, Block, CampaignStep, OUTPUTS};
use crate::decide;
use crate::knob::{INPUTS, Knob};
use crate::nuisance::{self, Constant};
use crate::planted::Planted;
use crate::refine::Refined;
use crate::report::DriftReport;
use crate::simulate::{Drive, Prediction};
use crate::{Cause, DriftError, DriftRequest, correct, plausible, repeats};
use mapper_core::{Channel, DeclaredUncertainty, Dimension, Recording};
use nalgebra::DMatrix;

/// Stretches closer to the surge line are left out: there a hundredth of P2 is a third of the flow, and no parameter's
/// effect is linear.
const SURGE_LIMIT: f64 = 0.97;
/// Noise of a sample where none is declared.
fn usual_noise(channel: Channel) -> f64 {
    match channel.info().dimension {
        Dimension::RotationalSpeed => 30.0,
        Dimension::MassFlow => 1.5e-4,
        Dimension::Pressure => 60.0,
        Dimension::Temperature | Dimension::Ratio => 0.2,
    }
}
/// Begin of each run that is left out, s: what the rig did before is not known, and rigs are still settling.
const FIRST_S: f64 = 30.0;
/// What the model leaves unexplained in the mean of a stretch, over the noise of one sample.
const MODEL_FLOOR: f64 = 0.15;

/// All readings beside the model.
pub(crate) struct Readings {
    pub runs: usize,
    pub steps: Vec<CampaignStep>,
    /// Stretches that are compared.
    pub blocks: Vec<Block>,
    /// Channels that are compared, as positions in [`OUTPUTS`].
    pub columns: Vec<usize>,
    /// Reading less model, channel after channel, stretch after stretch.
    pub difference: Vec<f64>,
    /// The model, in the same order.
    pub model: Vec<f64>,
    /// How readings and points answer to each of [`Knob::ALL`], per unit.
    pub answers: Vec<Constant>,
    /// Efficiency and heat-transfer coefficient of the model at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
    /// Mean of each of [`INPUTS`].
    pub input_levels: Vec<f64>,
    /// Positions of the stretches that are compared among all.
    kept: Vec<usize>,
    /// Every stretch with its readings and the nominal model's, those that are not compared included.
    pub all: Vec<(Block, [Option<f64>; OUTPUTS.len()], [f64; OUTPUTS.len()])>,
}

impl Readings {
    pub fn answer(&self, knob: Knob) -> Option<&Constant> {
        Knob::ALL.iter().position(|other| *other == knob).and_then(|index| self.answers.get(index))
    }

    pub fn input_level(&self, channel: Channel) -> f64 {
        INPUTS
            .iter()
            .position(|input| *input == channel)
            .and_then(|index| self.input_levels.get(index))
            .copied()
            .unwrap_or(0.0)
    }

    /// Begin of the campaign and end of its last step, time of the campaign, s.
    pub fn span_s(&self) -> (f64, f64) {
        let start = self.steps.first().map_or(0.0, |step| step.start_s + step.offset_s);
        let end = self.steps.last().map_or(0.0, |step| step.end_s + step.offset_s);
        (start, end)
    }

    /// A cause of unit size all the time, as readings and points show it; `None` where nothing shows it.
    pub fn signature(&self, cause: Cause) -> Option<Constant> {
        let of_knob = |knob: Knob, factor: f64| {
            let answer = self.answer(knob)?;
            let times = |values: &[f64]| values.iter().map(|value| factor * value).collect();
            Some(Constant {
                readings: times(&answer.readings),
                eta: times(&answer.eta),
                h_w_m2k: times(&answer.h_w_m2k),
            })
        };
        match cause {
            Cause::Fouling => {
                let (mut sum, flow) =
                    (of_knob(Knob::Efficiency, 1.0)?, of_knob(Knob::Flow, crate::cause::FOULING_FLOW_SHARE)?);
                let add = |into: &mut Vec<f64>, from: &[f64]| {
                    into.iter_mut().zip(from).for_each(|(into, from)| *into += from);
                };
                add(&mut sum.readings, &flow.readings);
                add(&mut sum.eta, &flow.eta);
                add(&mut sum.h_w_m2k, &flow.h_w_m2k);
                Some(sum)
            }
            Cause::BearingFriction => of_knob(Knob::Friction, 1.0),
            // An input that reads too high drives the model too high: the truth lies below.
            Cause::Sensor(channel) if INPUTS.contains(&channel) => of_knob(Knob::Input(channel), -1.0),
            Cause::Sensor(channel) => {
                let output = OUTPUTS.iter().position(|output| *output == channel)?;
                let column = self.columns.iter().position(|column| *column == output)?;
                let count = self.columns.len();
                let readings = (0..self.difference.len())
                    .map(|row| match row % count == column {
                        true if cause.is_gain() => self.model[row],
                        true => 1.0,
                        false => 0.0,
                    })
                    .collect();
                let steps = self.steps.len();
                Some(Constant { readings, eta: vec![0.0; steps], h_w_m2k: vec![0.0; steps] })
            }
        }
    }

    /// The same readings beside another prediction; `None` where it does not say all that the first one said.
    pub fn around(&self, base: Prediction, turned: &[Prediction]) -> Option<Readings> {
        let columns = &self.columns;
        let rows = |values: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            self.kept
                .iter()
                .flat_map(|block| columns.iter().map(move |column| values(*block, *column)))
                .collect()
        };
        let answers = Knob::ALL
            .iter()
            .zip(turned)
            .map(|(knob, turned)| Constant {
                readings: rows(&|block, column| {
                    (turned.means[block][column] - base.means[block][column]) / knob.step()
                }),
                eta: (0..self.steps.len())
                    .map(|step| finite((turned.step_ends[step].0 - base.step_ends[step].0) / knob.step()))
                    .collect(),
                h_w_m2k: (0..self.steps.len())
                    .map(|step| finite((turned.step_ends[step].1 - base.step_ends[step].1) / knob.step()))
                    .collect(),
            })
            .collect();
        let readings = Readings {
            runs: self.runs,
            steps: self.steps.clone(),
            blocks: self.blocks.clone(),
            columns: self.columns.clone(),
            difference: rows(&|block, column| {
                self.all[block].1[column].unwrap_or(f64::NAN) - base.means[block][column]
            }),
            model: rows(&|block, column| base.means[block][column]),
            answers,
            step_ends: base.step_ends,
            input_levels: self.input_levels.clone(),
            kept: self.kept.clone(),
            all: self.all.clone(),
        };
        readings.difference.iter().all(|value| value.is_finite()).then_some(readings)
    }

    /// Takes a linear part out of the model, as large as `of_rows` says in the readings, as `of_steps` at the steps' ends.
    pub fn give_back(&mut self, part: &Constant, of_rows: &[f64], of_steps: &[f64]) {
        for ((difference, shown), size) in self.difference.iter_mut().zip(&part.readings).zip(of_rows) {
            *difference += shown * size;
        }
        for (step, ((eta, h_w_m2k), size)) in self.step_ends.iter_mut().zip(of_steps).enumerate() {
            *eta -= part.eta[step] * size;
            *h_w_m2k -= part.h_w_m2k[step] * size;
        }
    }
}

/// Says whether anything drifted, and what.
///
/// # Errors
/// [`DriftError`] where a recording has no steps or too few channels, or the model cannot follow it. A recording that is
/// sound but cannot tell (no repeats, a gap, another machine) gives a report with the verdict `unclear` and its reason.
pub fn diagnose(request: &DriftRequest<'_>) -> Result<DriftReport, DriftError> {
    if request.runs.is_empty() {
        return Err(DriftError::NoRun);
    }
    let recordings: Vec<&Recording> = request.runs.iter().map(|run| run.recording).collect();
    let steps = blocks::steps(&recordings);
    let groups = repeats::groups(&steps);
    if let Some(reason) = repeats::refusal(request.runs, &steps, &groups) {
        return Ok(DriftReport::without_verdict(reason));
    }
    let (readings, mut drives) = read(request, &recordings, steps)?;
    let declared =
        |channel: Channel| request.identification.declared.get(&channel).copied().unwrap_or_default();
    let constants = nuisance::constants(&readings, &declared);
    let own = own_covariances(request, &recordings, &readings, &declared);
    let columns = DMatrix::from_fn(readings.difference.len(), constants.len(), |row, column| {
        constants[column].readings[row]
    });
    let (decision, fit) = decide::decide(&readings, own, &columns, request.seed)?;
    let mut refined = Refined { readings, constants, fit };
    if decision.flagged {
        refined = refined.around(&mut drives, &declared, &decision);
    }
    correct::report(request, &recordings, &refined, &groups, &decision)
}

/// What the model says of all runs with what is planted, and with each knob turned beside it.
pub(crate) fn predict(
    drives: &mut [Drive<'_>],
    planted: Option<Planted>,
) -> Result<(Prediction, Vec<Prediction>), DriftError> {
    let mut base = Prediction { means: Vec::new(), surge_position_ratio: Vec::new(), step_ends: Vec::new() };
    let mut turned: Vec<Prediction> = vec![base.clone(); Knob::ALL.len()];
    for (run, drive) in drives.iter_mut().enumerate() {
        let (own_base, own_turned) =
            drive.predict_all(planted).map_err(|source| DriftError::Drive { run, source })?;
        append(&mut base, own_base);
        turned.iter_mut().zip(own_turned).for_each(|(all, own)| append(all, own));
    }
    Ok((base, turned))
}

/// Reads all stretches and drives the model through all runs.
fn read<'a>(
    request: &DriftRequest<'a>,
    recordings: &[&Recording],
    steps: Vec<CampaignStep>,
) -> Result<(Readings, Vec<Drive<'a>>), DriftError> {
    for (run, recording) in recordings.iter().enumerate() {
        let missing: Vec<&str> = [Channel::ShaftSpeed, Channel::P2, Channel::T2, Channel::T1]
            .into_iter()
            .filter(|channel| recording.require(*channel).is_err())
            .map(Channel::symbol)
            .collect();
        if !missing.is_empty() {
            let message = format!(
                "it has no {}; drift is judged by all of N, P2, T1, T2, the more the better",
                missing.join(", ")
            );
            return Err(DriftError::Unusable { run, message });
        }
        if let Some(message) = plausible::implausible(recording) {
            return Err(DriftError::Unusable { run, message });
        }
    }
    let columns: Vec<usize> = (0..OUTPUTS.len())
        .filter(|output| recordings.iter().all(|recording| recording.require(OUTPUTS[*output]).is_ok()))
        .collect();
    let all_blocks = blocks::blocks(&steps);
    let mut drives: Vec<Drive<'a>> = recordings
        .iter()
        .enumerate()
        .map(|(run, recording)| {
            Drive::new(run, recording, request.model, &request.boundary, &steps, &all_blocks)
        })
        .collect::<Result<_, _>>()?;
    let (base, turned) = predict(&mut drives, None)?;
    let all: Vec<_> = all_blocks
        .iter()
        .zip(&base.means)
        .map(|(block, model)| {
            let recording = recordings[steps[block.step].run];
            (*block, OUTPUTS.map(|channel| blocks::mean(recording, channel, block)), *model)
        })
        .collect();
    let kept: Vec<usize> = (0..all.len())
        .filter(|index| {
            let step = &steps[all[*index].0.step];
            let begins = step.from.is_none() && all[*index].0.start_s < step.start_s + FIRST_S;
            !begins
                && base.surge_position_ratio[*index] < SURGE_LIMIT
                && columns
                    .iter()
                    .all(|column| all[*index].1[*column].is_some() && all[*index].2[*column].is_finite())
        })
        .collect();
    if kept.is_empty() {
        let message = "no stretch of it can be compared with the model: readings are missing or no numbers, or all of it lies \
                       at the surge line. Look at its channels and their units, and whether the campaign names the machine";
        return Err(DriftError::Unusable { run: 0, message: message.to_owned() });
    }
    let input_levels = INPUTS
        .iter()
        .map(|channel| {
            let values: Vec<f64> = recordings
                .iter()
                .filter_map(|r| r.series.get(channel))
                .flat_map(|s| s.values.iter().copied())
                .collect();
            if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
        })
        .collect();
    let frame = Readings {
        runs: recordings.len(),
        blocks: kept.iter().map(|index| all_blocks[*index]).collect(),
        difference: Vec::new(),
        model: Vec::new(),
        answers: Vec::new(),
        step_ends: Vec::new(),
        input_levels,
        columns,
        steps,
        kept,
        all,
    };
    let readings = frame.around(base, &turned).ok_or_else(|| DriftError::Numbers {
        message: "a reading or the model's answer is not finite".to_owned(),
    })?;
    Ok((readings, drives))
}

/// 0 for steps that the model cannot follow, which have no point.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

fn append(all: &mut Prediction, own: Prediction) {
    all.means.extend(own.means);
    all.surge_position_ratio.extend(own.surge_position_ratio);
    all.step_ends.extend(own.step_ends);
}

/// Covariance of the readings of each stretch: the sensors' noise, and that of the inputs through the model.
fn own_covariances(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    readings: &Readings,
    declared: &dyn Fn(Channel) -> DeclaredUncertainty,
) -> Vec<DMatrix<f64>> {
    let noise = |channel: Channel| {
        let sigma = declared(channel).noise_sigma;
        if sigma > 0.0 { sigma } else { usual_noise(channel) }
    };
    let count = readings.columns.len();
    readings
        .blocks
        .iter()
        .enumerate()
        .map(|(index, block)| {
            let recording = recordings[readings.steps[block.step].run];
            let samples = recording
                .series
                .get(&Channel::T2)
                .map_or(1, |series| series.range(block.start_s, block.end_s - 1e-6).len());
            let ratio =
                blocks::mean_variance_ratio(request.identification.noise_colour, block.length_s(), samples);
            let mut covariance = DMatrix::zeros(count, count);
            for (position, column) in readings.columns.iter().enumerate() {
                covariance[(position, position)] =
                    noise(OUTPUTS[*column]).powi(2) * (ratio + MODEL_FLOOR * MODEL_FLOOR);
            }
            for channel in INPUTS {
                let Some(answer) = readings.answer(Knob::Input(channel)) else { continue };
                let of_block = &answer.readings[index * count..(index + 1) * count];
                let variance = noise(channel).powi(2) * ratio;
                for (row, a) in of_block.iter().enumerate() {
                    for (column, b) in of_block.iter().enumerate() {
                        covariance[(row, column)] += variance * a * b;
                    }
                }
            }
            covariance
        })
        .collect()
}
