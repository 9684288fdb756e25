//! The report: visits of the repeated jumps, and the points of the map without the drift.

use crate::blocks::{CampaignStep, OUTPUTS};
use crate::decide::Decision;
use crate::fit::Fit;
use crate::refine::Refined;
use crate::report::{
    CorrectedPoint, DriftReport, DriftVerdict, RateOrStep, RepeatGroup, Visit, VisitChannel,
};
use crate::study::Readings;
use crate::{Cause, Course, CourseKind, DriftError, DriftRequest, blocks};
use mapper_core::{Channel, IdentifiedPoint, Recording};
use mapper_identify::identify_each;
use nalgebra::DVector;
use std::collections::BTreeMap;

pub(crate) fn report(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refined,
    groups: &[Vec<usize>],
    decision: &Decision,
) -> Result<DriftReport, DriftError> {
    let points: Vec<Vec<IdentifiedPoint>> =
        recordings.iter().map(|recording| identified(recording, request)).collect();
    let (readings, fit) = (&refined.readings, &refined.fit);
    let groups = groups.iter().map(|visits| group(request, recordings, readings, &points, visits)).collect();
    let verdict = match (decision.flagged, decision.clear) {
        (false, _) => DriftVerdict::None,
        (true, false) => DriftVerdict::Unclear,
        (true, true) => decision.cause.kind().into(),
    };
    let found = decision.flagged.then_some(decision.cause);
    let (own, others): (Vec<_>, Vec<_>) =
        decision.probabilities.iter().copied().partition(|alternative| alternative.cause == found);
    let corrected_points = if decision.flagged {
        corrected_points(request, recordings, refined, &points, decision.cause)
    } else {
        Vec::new()
    };
    let only_found = |value: f64| decision.flagged.then_some(value);
    Ok(DriftReport {
        verdict,
        cause: found,
        probability: own.first().map_or(0.0, |alternative| alternative.probability),
        alternatives: others,
        onset_s: only_found(fit.course.onset_s),
        onset_low_s: only_found(fit.onset_low_s),
        onset_high_s: only_found(fit.onset_high_s),
        size: decision.flagged.then(|| size(fit)),
        low: only_found(fit.low),
        high: only_found(fit.high),
        unit: found.map(Cause::unit),
        reason: reason(decision, fit, verdict),
        evidence: decision.evidence,
        threshold: decision.threshold,
        detection_limits: decision.limits.clone(),
        groups,
        corrected_points,
    })
}

fn reason(decision: &Decision, fit: &Fit, verdict: DriftVerdict) -> String {
    let left_out = match decision.left_out {
        (0, _) => String::new(),
        (count, all) => format!("; {count} of {all} stretches are left out, the model cannot follow them"),
    };
    let compared = format!(
        "the best cause has an evidence of {:.1}, one drift-free campaign in a hundred reaches {:.1}{left_out}",
        decision.evidence, decision.threshold
    );
    if verdict == DriftVerdict::None {
        return format!("Nothing drifted: {compared}.");
    }
    let unit = decision.cause.unit();
    let size = match size(fit) {
        RateOrStep::RatePerH(rate) => format!("drifts by {rate:.4} {unit} per hour from"),
        RateOrStep::Step(step) => format!("steps by {step:.4} {unit} at"),
    };
    let what = format!("{} {size} {:.0} s on", decision.cause, fit.course.onset_s);
    let corrected = match decision.cause {
        Cause::Sensor(channel) => format!(
            "The corrected points have this taken off the reading of {}; the recording is as it was.",
            channel.symbol()
        ),
        Cause::Fouling => {
            "The corrected points have their efficiency brought to the machine at the campaign's start.".to_owned()
        }
        Cause::BearingFriction => {
            "Friction leaves the efficiency of the compressor as it is; the corrected points are the fitted ones.".to_owned()
        }
    };
    match verdict {
        DriftVerdict::Unclear => format!(
            "Something drifted ({compared}), but the recording does not tell what; most probable: {what}. {corrected}"
        ),
        _ => format!("{what} ({compared}). {corrected}"),
    }
}

/// Points of a run; none where the recording cannot be identified.
fn identified(recording: &Recording, request: &DriftRequest<'_>) -> Vec<IdentifiedPoint> {
    identify_each(recording, request.identification)
        .map(|points| points.into_iter().filter_map(Result::ok).collect())
        .unwrap_or_default()
}

fn point_of<'a>(points: &'a [Vec<IdentifiedPoint>], step: &CampaignStep) -> Option<&'a IdentifiedPoint> {
    points.get(step.run)?.iter().find(|point| point.step == step.index)
}

fn group(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    readings: &Readings,
    points: &[Vec<IdentifiedPoint>],
    visits: &[usize],
) -> RepeatGroup {
    let in_words = |step: Option<&CampaignStep>| {
        let speed = |step: &CampaignStep| {
            let series = recordings[step.run].series.get(&Channel::ShaftSpeed)?;
            let values = series.slice(step.end_s - 5.0, step.end_s - 1e-6).1;
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        step.map_or_else(String::new, |step| {
            let speed =
                speed(step).map_or_else(|| "-".to_owned(), |speed_rpm| format!("{:.1}", speed_rpm / 1e3));
            format!("{speed} krpm at opening {} (P3 {:.1} kPa)", step.valve_opening_ratio, step.p3_pa / 1e3)
        })
    };
    let first = visits.first().copied();
    let before =
        first.and_then(|position| position.checked_sub(1)).and_then(|position| readings.steps.get(position));
    let mut group = RepeatGroup {
        from: in_words(before),
        to: in_words(first.and_then(|position| readings.steps.get(position))),
        visits: Vec::new(),
    };
    for position in visits {
        let Some(step) = readings.steps.get(*position) else { continue };
        let point = point_of(points, step);
        let eta = point.and_then(|point| point.eta);
        let h_w_m2k = point.and_then(|point| point.h_w_m2k);
        let since = |now: Option<f64>, first: Option<Option<f64>>| Some(now? - first.unwrap_or(now)?);
        let first = group.visits.first();
        group.visits.push(Visit {
            run: step.run,
            step: step.index,
            t_s: step.start_s + step.offset_s,
            eta,
            sigma_eta: point.and_then(|point| Some(point.eta_uncertainty?.noise_standard_error)),
            change_eta: since(eta, first.map(|visit| visit.eta)),
            h_w_m2k,
            sigma_h_w_m2k: point.and_then(|point| Some(point.h_uncertainty?.noise_standard_error)),
            change_h_w_m2k: since(h_w_m2k, first.map(|visit| visit.h_w_m2k)),
            channels: visit_channels(request, recordings, readings, *position),
        });
    }
    group
}

fn visit_channels(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    readings: &Readings,
    position: usize,
) -> BTreeMap<&'static str, VisitChannel> {
    let own: Vec<_> = readings.all.iter().filter(|(block, ..)| block.step == position).collect();
    let (Some(transient), Some(end)) = (own.first(), own.last()) else { return BTreeMap::new() };
    let recording = recordings[readings.steps[position].run];
    let entry = |(column, channel): (usize, &Channel)| {
        let value = end.1[column]?;
        let samples = recording.series.get(channel)?.range(end.0.start_s, end.0.end_s - 1e-6).len();
        let ratio =
            blocks::mean_variance_ratio(request.identification.noise_colour, end.0.length_s(), samples);
        let declared =
            request.identification.declared.get(channel).map_or(0.0, |declared| declared.noise_sigma);
        let read = VisitChannel {
            end: value,
            end_less_model: value - end.2[column],
            transient_less_model: transient.1[column]
                .filter(|_| own.len() > 1)
                .map(|value| value - transient.2[column]),
            sigma: declared * ratio.sqrt(),
        };
        Some((channel.symbol(), read))
    };
    OUTPUTS.iter().enumerate().filter_map(entry).collect()
}

/// Rate or step of a fit.
fn size(fit: &Fit) -> RateOrStep {
    match fit.course.kind {
        CourseKind::Ramp => RateOrStep::RatePerH(fit.size),
        CourseKind::Step => RateOrStep::Step(fit.size),
    }
}

/// All points, the drift taken out.
fn corrected_points(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refined,
    points: &[Vec<IdentifiedPoint>],
    cause: Cause,
) -> Vec<CorrectedPoint> {
    let Refined { readings, constants, fit } = refined;
    let signature = readings.signature(cause);
    let corrected: Vec<Vec<IdentifiedPoint>> = (0..recordings.len())
        .map(|run| match cause {
            Cause::Sensor(channel) => {
                let offset_s =
                    readings.steps.iter().find(|step| step.run == run).map_or(0.0, |step| step.offset_s);
                identified(&undrifted(recordings[run], channel, offset_s, fit), request)
            }
            Cause::Fouling | Cause::BearingFriction => points[run].clone(),
        })
        .collect();
    readings
        .steps
        .iter()
        .enumerate()
        .filter_map(|(position, step)| {
            let drift = fit.drift_at(step.end_s + step.offset_s);
            // A step that the model cannot follow has no point.
            let (mut eta, mut h_w_m2k) =
                *readings.step_ends.get(position).filter(|(eta, _)| eta.is_finite())?;
            for (constant, size) in constants.iter().zip(fit.constants.iter()) {
                eta += constant.eta[position] * size;
                h_w_m2k += constant.h_w_m2k[position] * size;
            }
            if let Some(signature) = &signature {
                eta += signature.eta[position] * drift;
                h_w_m2k += signature.h_w_m2k[position] * drift;
            }
            // What the machine at the campaign's start would have had at this operating point.
            let fouled = if cause == Cause::Fouling { 1.0 + drift } else { 1.0 };
            let weights = DVector::from_iterator(constants.len(), constants.iter().map(|c| c.eta[position]));
            let identified = point_of(&corrected, step).and_then(|point| point.eta);
            let recorded = point_of(points, step);
            Some(CorrectedPoint {
                run: step.run,
                step: step.index,
                speed_rpm: recorded
                    .map_or_else(|| mean_speed_rpm(recordings[step.run], step), |point| point.speed_rpm),
                valve: step.valve_opening_ratio,
                eta: eta / fouled,
                sigma_eta: fit.noise.variance(&weights).max(0.0).sqrt(),
                h_w_m2k,
                eta_identified: identified.map(|eta| eta / fouled),
                eta_uncorrected: recorded.and_then(|point| point.eta),
                correction: drift,
            })
        })
        .collect()
}

fn mean_speed_rpm(recording: &Recording, step: &CampaignStep) -> f64 {
    let values =
        recording.series.get(&Channel::ShaftSpeed).map(|series| series.slice(step.end_s - 5.0, step.end_s).1);
    values.map_or(f64::NAN, |values| values.iter().sum::<f64>() / values.len().max(1) as f64)
}

/// The recording with the drift of one sensor taken off.
fn undrifted(recording: &Recording, channel: Channel, offset_s: f64, fit: &Fit) -> Recording {
    take_off(recording, channel, &|t_s| fit.drift_at(t_s + offset_s))
}

/// The first recording with the drift of its sensor, as reported, taken off; `None` where no sensor was found to drift.
pub fn without_drift(recording: &Recording, report: &DriftReport) -> Option<Recording> {
    let (Some(Cause::Sensor(channel)), Some(onset_s), Some(size)) =
        (report.cause, report.onset_s, report.size)
    else {
        return None;
    };
    let (kind, size) = match size {
        RateOrStep::RatePerH(rate) => (CourseKind::Ramp, rate),
        RateOrStep::Step(step) => (CourseKind::Step, step),
    };
    let course = Course { kind, onset_s };
    Some(take_off(recording, channel, &|t_s| size * course.at(t_s)))
}

fn take_off(recording: &Recording, channel: Channel, drift_at: &dyn Fn(f64) -> f64) -> Recording {
    let mut recording = recording.clone();
    if let Some(series) = recording.series.get_mut(&channel) {
        for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
            let drift = drift_at(*t_s);
            *value = if Cause::Sensor(channel).is_gain() { *value / (1.0 + drift) } else { *value - drift };
        }
    }
    recording
}
