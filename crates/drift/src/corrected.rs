//! The points of the map without the drift.

use crate::blocks::CampaignStep;
use crate::cause::Cause;
use crate::refine::Refined;
use crate::report::CorrectedPoint;
use crate::request::DriftRequest;
use crate::take_off::take_off;
use mapper_core::{Channel, IdentifiedPoint, Recording};
use mapper_identify::identify_each;
use mapper_observe::mean::mean_between;
use nalgebra::DVector;

/// What is called the end of a step, s.
const END_S: f64 = 5.0;

/// Points of a run; none where the recording cannot be identified.
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

/// All points, the drift taken out.
pub(crate) fn corrected_points(
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
                let drift_at = |t_s: f64| fit.drift_at(t_s + offset_s);
                identified(&take_off(recordings[run], channel, &drift_at), request)
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
                speed_rpm: recorded.map_or_else(
                    || end_speed_rpm(recordings[step.run], step).unwrap_or(f64::NAN),
                    |point| point.speed_rpm,
                ),
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

/// Mean speed of the last seconds of a step, rpm.
pub(crate) fn end_speed_rpm(recording: &Recording, step: &CampaignStep) -> Option<f64> {
    mean_between(recording, Channel::ShaftSpeed, step.end_s - END_S, step.end_s, 1)
}
