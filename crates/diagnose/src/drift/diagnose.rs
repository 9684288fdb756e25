//! Diagnoses drift from recordings, and reports it.

use crate::drift::causes::{Cause, CauseKind, Drift};
use crate::drift::correction::{corrected_points, group, identified};
use crate::drift::drive::{Drive, predict};
use crate::drift::readings::{Readings, Response, SegmentMeans};
use crate::drift::refinement::{Decision, DetectedCause, FittedDrift, Refinement};
use crate::drift::report::{DriftReport, DriftVerdict, FoundDrift, RateOrStep};
use crate::drift::runs;
use crate::drift::runs::{
    CampaignStep, DriftError, DriftRequest, Segment, Unsolvable, mean_variance_ratio, usable,
};
use crate::gap::residuals::true_inputs::SETTLING_S;
use crate::gap::residuals::whiten::NEAR_SURGE;
use mapper_core::{Channel, IdentifiedPoint, Recording, probability_text};
use mapper_inference::hypotheses::Shape;
use mapper_numerics::statistics::mean;
use mapper_observe::averages::{INPUT_CHANNELS, OUTPUTS};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;
use nalgebra::DMatrix;

/// Model error of a segment's mean, relative to the noise of one sample: that of a mean of 44 independent samples, so that a longer segment
/// gains no more weight. Judgement: the model follows no segment better.
const MODEL_ERROR_RATIO: f64 = 0.15;

/// Finds the causes of drift.
pub fn diagnose(request: &DriftRequest<'_>) -> Result<DriftReport, DriftError> {
    if request.runs.is_empty() {
        return Err(DriftError::NoRun);
    }
    let recordings: Vec<&Recording> = request.runs.iter().map(|run| run.recording).collect();
    let steps = runs::steps(&recordings);
    let groups = runs::groups(&steps);
    if let Some(reason) = runs::refusal(request.runs, &steps, &groups) {
        return Ok(DriftReport::without_verdict(reason));
    }
    let first_visits = groups.iter().filter_map(|visits| steps.get(*visits.first()?));
    let unseen_before_s = first_visits.map(|step| step.end_s + step.offset_s).reduce(f64::min);
    let (readings, mut drives) = read(request, &recordings, (steps, unseen_before_s))?;
    let declared = request.declared();
    let own = own_covariances(&recordings, &readings, &declared);
    let refined = Refinement::new(readings, &own, &mut drives, &declared)?;
    Ok(conclude(request, &recordings, &refined, &groups))
}

/// Reads all segments and drives the model through all runs.
fn read<'a>(
    request: &DriftRequest<'a>,
    recordings: &[&Recording],
    (steps, unseen_before_s): (Vec<CampaignStep>, Option<f64>),
) -> Result<(Readings, Vec<Drive<'a>>), DriftError> {
    for (run, recording) in recordings.iter().enumerate() {
        usable(run, recording, request.identification.thresholds.lost_samples_ratio)?;
    }
    let columns: Vec<usize> = (0..OUTPUTS.len())
        .filter(|output| recordings.iter().all(|recording| recording.require(OUTPUTS[*output]).is_ok()))
        .collect();
    let segments = runs::segments(&steps);
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
            let measured = OUTPUTS.map(|channel| runs::mean(recording, channel, segment));
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
        unseen_before_s,
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

pub(crate) fn conclude(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refinement,
    groups: &[Vec<usize>],
) -> DriftReport {
    let decision = &refined.decision;
    let points: Vec<Vec<IdentifiedPoint>> =
        recordings.iter().map(|recording| identified(recording, request)).collect();
    let groups =
        groups.iter().map(|visits| group(request, recordings, &refined.readings, &points, visits)).collect();
    let drifts: Vec<FoundDrift> =
        decision.detected.iter().zip(&refined.fits.drifts).map(|(cause, fit)| drift(cause, fit)).collect();
    let verdict = verdict(&drifts);
    let corrected_points =
        if drifts.is_empty() { Vec::new() } else { corrected_points(request, recordings, refined, &points) };
    DriftReport {
        verdict,
        reason: reason(decision, &drifts, verdict),
        drifts,
        alone: decision.alone.clone(),
        unseen_before_s: refined.readings.unseen_before_s,
        detection_limits: decision.limits.clone(),
        groups,
        corrected_points,
    }
}

fn drift(detected: &DetectedCause, fit: &FittedDrift) -> FoundDrift {
    let Drift { cause, history, size } = fit.drift;
    FoundDrift {
        cause,
        probability: detected.probability,
        alternatives: detected.alternatives.clone(),
        onset_s: history.onset,
        onset_low_s: fit.onset_low_s,
        onset_high_s: fit.onset_high_s,
        size: match history.shape {
            Shape::Ramp(_) => RateOrStep::RatePerH(size),
            Shape::Step | Shape::Decay(_) => RateOrStep::Step(size),
        },
        low: fit.low,
        high: fit.high,
        unit: cause.unit().into(),
    }
}

fn verdict(drifts: &[FoundDrift]) -> DriftVerdict {
    let any = |kind: CauseKind| drifts.iter().any(|drift| drift.cause.kind() == kind);
    match (any(CauseKind::Sensor), any(CauseKind::Machine)) {
        (false, false) => DriftVerdict::None,
        _ if !drifts.iter().all(FoundDrift::is_clear) => DriftVerdict::Unclear,
        (true, false) => DriftVerdict::Sensor,
        (false, true) => DriftVerdict::Machine,
        (true, true) => DriftVerdict::SensorAndMachine,
    }
}

fn reason(decision: &Decision, drifts: &[FoundDrift], verdict: DriftVerdict) -> String {
    let left_out = match decision.left_out {
        (0, _) => String::new(),
        (count, all) => {
            format!(" {count} of {all} segments are left out because the model cannot follow them.")
        }
    };
    if verdict == DriftVerdict::None {
        let probability =
            decision.alone.iter().find(|one| one.cause.is_none()).map_or(1.0, |none| none.probability);
        return format!(
            "Nothing drifted, with a probability of {}.{left_out}",
            probability_text(probability)
        );
    }
    let descriptions: Vec<String> = drifts.iter().map(describe).collect();
    let corrections: Vec<String> = drifts.iter().map(|drift| describe_correction(drift.cause)).collect();
    let (drifts, corrections) = (descriptions.join("; "), corrections.join(" "));
    match verdict {
        DriftVerdict::Unclear => format!(
            "Something drifted, but the recording does not show what; most probable: {drifts}. {corrections}{left_out}"
        ),
        _ => format!("{drifts}. {corrections}{left_out}"),
    }
}

fn describe(drift: &FoundDrift) -> String {
    let size = match drift.size {
        RateOrStep::RatePerH(rate) => format!("drifts by {} per hour from", drift.cause.show(rate)),
        RateOrStep::Step(step) => format!("steps by {} at", drift.cause.show(step)),
    };
    format!(
        "{} {size} {:.0} s on, with a probability of {}",
        drift.cause,
        drift.onset_s,
        probability_text(drift.probability)
    )
}

fn describe_correction(cause: Cause) -> String {
    match cause {
        Cause::Sensors(_) => format!(
            "For the corrected points this is subtracted from the reading of {cause}; the recording is unchanged."
        ),
        Cause::Fouling => {
            "The efficiency of the corrected points is that of the machine at the campaign's start."
                .to_owned()
        }
        Cause::BearingFriction => {
            "Friction does not change the compressor's efficiency; the corrected points are the fitted ones."
                .to_owned()
        }
    }
}
