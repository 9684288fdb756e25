//! Diagnoses drift from recordings.

use crate::drift::conclude::conclude;
use crate::drift::likelihood::refinement::Refinement;
use crate::drift::report::DriftReport;
use crate::drift::runs::repeats;
use crate::drift::runs::request::{DriftError, DriftRequest, Unsolvable};
use crate::drift::runs::time_axis::{self, CampaignStep, Segment, mean_variance_ratio};
use crate::drift::runs::usable::usable;
use crate::drift::sensitivity::drive::{Drive, predict};
use crate::drift::sensitivity::readings::{Readings, Response, SegmentMeans};
use crate::gap::residuals::initial_state::SETTLING_S;
use crate::gap::residuals::whiten::NEAR_SURGE;
use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::mean;
use mapper_observe::channels::{INPUT_CHANNELS, OUTPUTS};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;
use nalgebra::DMatrix;

/// Model error of a segment's mean, relative to the noise of one sample: that of a mean of 44 independent samples, so that a longer segment
/// gains no more weight. Judgement.
const MODEL_ERROR_RATIO: f64 = 0.15;

/// Finds the causes of drift.
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
    let refined = Refinement::new(readings, &own, &mut drives, &declared)?;
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
    let segments = time_axis::segments(&steps);
    let mut drives: Vec<Drive<'a>> = recordings
        .iter()
        .enumerate()
        .map(|(run, recording)| Drive::new(run, recording, request, &steps, &segments))
        .collect::<Result<_, _>>()?;
    let (base, perturbed) = predict(&mut drives, &[])?;
    let all: Vec<SegmentMeans> = segments
        .iter()
        .zip(&base.means)
        .map(|(segment, nominal)| {
            let recording = recordings[steps[segment.step].run];
            let measured = OUTPUTS.map(|channel| time_axis::mean(recording, channel, segment));
            SegmentMeans { segment: *segment, measured, nominal: *nominal }
        })
        .collect();
    let kept: Vec<usize> = (0..all.len())
        .filter(|index| {
            let SegmentMeans { segment, measured, nominal } = &all[*index];
            let step = &steps[segment.step];
            let is_settling = step.from.is_none() && segment.start_s < step.start_s + SETTLING_S;
            !is_settling
                && base.surge_position_ratio[*index] < NEAR_SURGE
                && columns.iter().all(|column| measured[*column].is_some() && nominal[*column].is_finite())
        })
        .collect();
    if kept.is_empty() {
        return Err(DriftError::NothingComparable);
    }
    let level = |channel: Channel| {
        let series = recordings.iter().filter_map(|recording| recording.series.get(&channel));
        Some((channel, mean(series.flat_map(|series| &series.values))?))
    };
    let unpredicted = Readings {
        runs: recordings.len(),
        segments: kept.iter().map(|index| segments[*index]).collect(),
        difference: DMatrix::zeros(0, 1),
        model: Response::zeros(0),
        responses: Vec::new(),
        input_levels: INPUT_CHANNELS.into_iter().filter_map(level).collect(),
        columns,
        steps,
        kept,
        all,
    };
    let readings = unpredicted.with_prediction(&base, &perturbed).ok_or(Unsolvable::NotFinite)?;
    Ok((readings, drives))
}

/// Covariance of the readings of each segment from the noise of their sensors, and from that of the inputs through the model.
fn own_covariances(recordings: &[&Recording], readings: &Readings, declared: &Declared) -> Vec<DMatrix<f64>> {
    let count = readings.columns.len();
    let of_segment = |(index, segment): (usize, &Segment)| {
        let recording = recordings[readings.steps[segment.step].run];
        let ratio = mean_variance_ratio(declared.noise_colour, recording, Channel::T2, segment);
        let mut covariance = DMatrix::zeros(count, count);
        for (position, column) in readings.columns.iter().enumerate() {
            covariance[(position, position)] = declared.noise_sigma(OUTPUTS[*column]).powi(2)
                * (ratio + MODEL_ERROR_RATIO * MODEL_ERROR_RATIO);
        }
        for channel in INPUT_CHANNELS {
            let Some(response) = readings.response(Perturbation::Input(channel)) else { continue };
            let response = response.rows(index * count, count);
            covariance.ger(declared.noise_sigma(channel).powi(2) * ratio, &response, &response, 1.0);
        }
        covariance
    };
    readings.segments.iter().enumerate().map(of_segment).collect()
}
