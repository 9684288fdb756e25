//! Removes a drift from readings and points.

use crate::drift::causes::{Cause, CauseKind, is_relative};
use crate::drift::readings::{Readings, Response};
use crate::drift::refinement::{FittedDrift, Refinement};
use crate::drift::report::{CorrectedPoint, DriftReport, FoundDrift, RepeatGroup, Visit, VisitChannel};
use crate::drift::runs::{CampaignStep, DriftRequest, mean_variance_ratio};
use mapper_core::unit_factors::{PA_PER_KPA, RPM_PER_KRPM};
use mapper_core::{Channel, IdentifiedPoint, Recording, valve_area_text};
use mapper_identify::identify_each;
use mapper_observe::averages::{OUTPUTS, mean_between};
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Points of a run; empty if the recording cannot be identified.
pub(crate) fn identified(recording: &Recording, request: &DriftRequest<'_>) -> Vec<IdentifiedPoint> {
    identify_each(recording, request.identification)
        .map(|points| points.into_iter().filter_map(Result::ok).collect())
        .unwrap_or_default()
}

pub(crate) fn point_of<'a>(
    points: &'a [Vec<IdentifiedPoint>],
    step: &CampaignStep,
) -> Option<&'a IdentifiedPoint> {
    points.get(step.run)?.iter().find(|point| point.step == step.index)
}

/// All points, with the drifts subtracted.
pub(crate) fn corrected_points(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refinement,
    points: &[Vec<IdentifiedPoint>],
) -> Vec<CorrectedPoint> {
    let Refinement { readings, constants, fits, .. } = refined;
    let drifts = &fits.drifts;
    let has_sensor_drift = drifts.iter().any(|fit| fit.drift.cause.kind() == CauseKind::Sensor);
    let signatures: Vec<(&FittedDrift, Response)> =
        drifts.iter().filter_map(|fit| Some((fit, readings.signature(fit.drift.cause)?))).collect();
    let corrected: Vec<Vec<IdentifiedPoint>> = (0..recordings.len())
        .map(|run| {
            if !has_sensor_drift {
                return points[run].clone();
            }
            let offset_s =
                readings.steps.iter().find(|step| step.run == run).map_or(0.0, |step| step.offset_s);
            identified(&without_drifts(recordings[run], drifts, offset_s), request)
        })
        .collect();
    readings
        .steps
        .iter()
        .enumerate()
        .filter_map(|(position, step)| {
            let at_end = |fit: &FittedDrift| fit.drift.at(step.end_s + step.offset_s);
            let positions = readings.point_positions(position);
            let [eta, h_w_m2k] = positions.map(|position| {
                let mut value = readings.model[position];
                for (constant, size) in constants.iter().zip(fits.constants.iter()) {
                    value += constant[position] * size;
                }
                for (fit, signature) in &signatures {
                    value += signature[position] * at_end(fit);
                }
                value
            });
            // A step that the model cannot follow gives no point.
            if !eta.is_finite() {
                return None;
            }
            // The corrected efficiency is that of the machine at the start of the campaign.
            let fouling = drifts.iter().find(|fit| fit.drift.cause == Cause::Fouling);
            let fouled = 1.0 + fouling.map_or(0.0, at_end);
            let weights = DVector::from_iterator(
                constants.len(),
                constants.iter().map(|constant| constant[positions[0]]),
            );
            let identified = point_of(&corrected, step).and_then(|point| point.eta);
            let recorded = point_of(points, step);
            Some(CorrectedPoint {
                run: step.run,
                step: step.index,
                speed_rpm: recorded.map_or_else(
                    || end_speed_rpm(request, recordings[step.run], step).unwrap_or(f64::NAN),
                    |point| point.speed_rpm,
                ),
                valve: step.valve_opening_ratio,
                eta: eta / fouled,
                sigma_eta: fits.noise.variance(&weights).max(0.0).sqrt(),
                h_w_m2k,
                eta_identified: identified.map(|eta| eta / fouled),
                eta_uncorrected: recorded.and_then(|point| point.eta),
                corrections: drifts.iter().map(at_end).collect(),
            })
        })
        .collect()
}

/// Mean speed of the last seconds of a step, rpm.
pub(crate) fn end_speed_rpm(
    request: &DriftRequest<'_>,
    recording: &Recording,
    step: &CampaignStep,
) -> Option<f64> {
    let start_s = step.end_s - request.identification.thresholds.steady_mean_s;
    mean_between(recording, Channel::ShaftSpeed, start_s, step.end_s, 1)
}

/// The first recording with the reported sensor drift subtracted; `None` if no sensor drifts.
pub(crate) fn without_drift(recording: &Recording, report: &DriftReport) -> Option<Recording> {
    let is_of_sensor = |drift: &FoundDrift| !drift.cause.channels().is_empty();
    report.drifts.iter().any(is_of_sensor).then_some(())?;
    let mut recording = recording.clone();
    for drift in &report.drifts {
        subtract(&mut recording, drift.cause.channels(), &|t_s| drift.at(t_s));
    }
    Some(recording)
}

/// The recording of a run that starts `offset_s` after the campaign, with the fitted drifts subtracted.
pub(crate) fn without_drifts(recording: &Recording, drifts: &[FittedDrift], offset_s: f64) -> Recording {
    let mut recording = recording.clone();
    for FittedDrift { drift, .. } in drifts {
        subtract(&mut recording, drift.cause.channels(), &|t_s| drift.at(t_s + offset_s));
    }
    recording
}

/// Subtracts `drift_at` (run time, s) from the readings of channels.
fn subtract(recording: &mut Recording, channels: &[Channel], drift_at: &dyn Fn(f64) -> f64) {
    for channel in channels {
        let Some(series) = recording.series.get_mut(channel) else { continue };
        for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
            let drift = drift_at(*t_s);
            *value = if is_relative(*channel) { *value / (1.0 + drift) } else { *value - drift };
        }
    }
}

pub(crate) fn group(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    readings: &Readings,
    points: &[Vec<IdentifiedPoint>],
    visits: &[usize],
) -> RepeatGroup {
    let describe = |step: Option<&CampaignStep>| {
        let speed = |step: &CampaignStep| end_speed_rpm(request, recordings[step.run], step);
        step.map_or_else(String::new, |step| {
            let speed = speed(step)
                .map_or_else(|| "-".to_owned(), |speed_rpm| format!("{:.1}", speed_rpm / RPM_PER_KRPM));
            format!(
                "{speed} krpm, valve area {} (P3 {:.1} kPa)",
                valve_area_text(step.valve_opening_ratio),
                step.p3_pa / PA_PER_KPA
            )
        })
    };
    let first = visits.first().copied();
    let before =
        first.and_then(|position| position.checked_sub(1)).and_then(|position| readings.steps.get(position));
    let mut group = RepeatGroup {
        from: describe(before),
        to: describe(first.and_then(|position| readings.steps.get(position))),
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
    let own: Vec<_> = readings.all.iter().filter(|means| means.segment.step == position).collect();
    let (Some(transient), Some(end)) = (own.first(), own.last()) else { return BTreeMap::new() };
    let recording = recordings[readings.steps[position].run];
    let declared = request.declared();
    let entry = |(column, channel): (usize, &Channel)| {
        let value = end.measured[column]?;
        let ratio = mean_variance_ratio(declared.noise_colour, recording, *channel, &end.segment);
        let read = VisitChannel {
            end: value,
            end_less_model: value - end.nominal[column],
            transient_less_model: transient.measured[column]
                .filter(|_| own.len() > 1)
                .map(|value| value - transient.nominal[column]),
            sigma: declared.noise_sigma(*channel) * ratio.sqrt(),
        };
        Some((channel.symbol(), read))
    };
    OUTPUTS.iter().enumerate().filter_map(entry).collect()
}
