//! Map points corrected for the drift.

use crate::drift::causes::cause::{Cause, CauseKind};
use crate::drift::correction::subtract_drift::without_drifts;
use crate::drift::likelihood::fit::FittedDrift;
use crate::drift::likelihood::refinement::Refinement;
use crate::drift::report::CorrectedPoint;
use crate::drift::runs::request::DriftRequest;
use crate::drift::runs::time_axis::CampaignStep;
use crate::drift::sensitivity::readings::Response;
use mapper_core::{Channel, IdentifiedPoint, Recording};
use mapper_identify::identify_each;
use mapper_observe::averages::mean_reading::mean_between;
use nalgebra::DVector;

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
