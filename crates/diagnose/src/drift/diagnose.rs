//! Diagnoses drift from recordings.

use crate::drift::conclude::conclude;
use crate::drift::likelihood::refine::Refined;
use crate::drift::report::DriftReport;
use crate::drift::runs::repeats;
use crate::drift::runs::request::{DriftError, DriftRequest, Unsolvable};
use crate::drift::runs::time_axis::{self, Block, CampaignStep, mean_variance_ratio};
use crate::drift::runs::usable::usable;
use crate::drift::sensitivity::drive::{Drive, predict};
use crate::drift::sensitivity::readings::Readings;
use crate::gap::residuals::whiten::NEAR_SURGE;
use mapper_core::{Channel, Recording};
use mapper_observe::channels::{DRIVERS, OUTPUTS};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;
use nalgebra::{DMatrix, DVector};

/// Start of each run that is left out, s: the rig's earlier history is unknown, and rigs are still settling.
const FIRST_S: f64 = 30.0;
/// Average model error over a segment, relative to the noise of one sample.
const MODEL_FLOOR: f64 = 0.15;

/// Reports whether anything drifted, and what.
///
/// # Errors
/// [`DriftError`] if a recording has no steps or too few channels, or the model cannot follow it. A valid recording without enough information
/// (no repeats, a gap, another machine) gives a report with the verdict `unclear` and its reason.
pub fn diagnose(request: &DriftRequest<'_>) -> Result<DriftReport, DriftError> {
    if request.runs.is_empty() {
        return Err(DriftError::NoRun);
    }
    let recordings: Vec<&Recording> = request.runs.iter().map(|run| run.recording).collect();
    let steps = time_axis::steps(&recordings);
    let groups = repeats::groups(&steps);
    if let Some(reason) = repeats::refusal(request.runs, &steps, &groups) {
        return Ok(DriftReport::without_verdict(reason));
    }
    let (readings, mut drives) = read(request, &recordings, steps)?;
    let declared = request.declared();
    let own = own_covariances(&recordings, &readings, &declared);
    let refined = Refined::new(readings, &own, &mut drives, &declared)?;
    Ok(conclude(request, &recordings, &refined, &groups))
}

/// Reads all segments and drives the model through all runs.
fn read<'a>(
    request: &DriftRequest<'a>,
    recordings: &[&Recording],
    steps: Vec<CampaignStep>,
) -> Result<(Readings, Vec<Drive<'a>>), DriftError> {
    for (run, recording) in recordings.iter().enumerate() {
        usable(run, recording, request.identification.thresholds.lost_samples_ratio)?;
    }
    let columns: Vec<usize> = (0..OUTPUTS.len())
        .filter(|output| recordings.iter().all(|recording| recording.require(OUTPUTS[*output]).is_ok()))
        .collect();
    let all_blocks = time_axis::blocks(&steps);
    let mut drives: Vec<Drive<'a>> = recordings
        .iter()
        .enumerate()
        .map(|(run, recording)| {
            Drive::new(run, recording, request.model, &request.boundary, &steps, &all_blocks)
        })
        .collect::<Result<_, _>>()?;
    let (base, turned) = predict(&mut drives, &[])?;
    let all: Vec<_> = all_blocks
        .iter()
        .zip(&base.means)
        .map(|(block, model)| {
            let recording = recordings[steps[block.step].run];
            (*block, OUTPUTS.map(|channel| time_axis::mean(recording, channel, block)), *model)
        })
        .collect();
    let kept: Vec<usize> = (0..all.len())
        .filter(|index| {
            let step = &steps[all[*index].0.step];
            let begins = step.from.is_none() && all[*index].0.start_s < step.start_s + FIRST_S;
            !begins
                && base.surge_position_ratio[*index] < NEAR_SURGE
                && columns
                    .iter()
                    .all(|column| all[*index].1[*column].is_some() && all[*index].2[*column].is_finite())
        })
        .collect();
    if kept.is_empty() {
        return Err(DriftError::NothingComparable);
    }
    let input_levels = DRIVERS
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
    let readings = frame.around(base, &turned).ok_or(Unsolvable::NotFinite)?;
    Ok((readings, drives))
}

/// Covariance of the readings of each segment: the sensors' noise, and that of the inputs through the model.
fn own_covariances(recordings: &[&Recording], readings: &Readings, declared: &Declared) -> Vec<DMatrix<f64>> {
    let count = readings.columns.len();
    let of_block = |(index, block): (usize, &Block)| {
        let recording = recordings[readings.steps[block.step].run];
        let ratio = mean_variance_ratio(declared.noise_colour, recording, Channel::T2, block);
        let mut covariance = DMatrix::zeros(count, count);
        for (position, column) in readings.columns.iter().enumerate() {
            covariance[(position, position)] =
                declared.noise_sigma(OUTPUTS[*column]).powi(2) * (ratio + MODEL_FLOOR * MODEL_FLOOR);
        }
        for channel in DRIVERS {
            let Some(answer) = readings.answer(Perturbation::Input(channel)) else { continue };
            let of_block = DVector::from_column_slice(&answer.readings[index * count..(index + 1) * count]);
            covariance.ger(declared.noise_sigma(channel).powi(2) * ratio, &of_block, &of_block, 1.0);
        }
        covariance
    };
    readings.blocks.iter().enumerate().map(of_block).collect()
}
