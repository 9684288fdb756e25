//! Repeats: the visit of each point that counts for the map, and the changes of efficiency between repeats of one jump, as evidence of drift.

use mapper_core::{IdentifiedPoint, OperatingPoint, StepKind, StepMarker, Verdict};
use serde::Serialize;

/// Selects the points of the map, in their order: one for each planned point.
///
/// A point without a usable efficiency is replaced by the repeat of the same target with the best verdict and, among these, the smallest
/// 95 % interval. The first point of a campaign has no jump before it, so only the joint method gives it an efficiency. If it is visited
/// again for that reason, the better visit by the same rule counts: a mean would claim too small an interval, since the visits share errors.
pub(crate) fn points_for_map(points: &[IdentifiedPoint]) -> Vec<IdentifiedPoint> {
    let repeats = || {
        points.iter().filter(|point| point.kind != StepKind::Point && point.target.is_some() && usable(point))
    };
    let order = |a: &&IdentifiedPoint, b: &&IdentifiedPoint| {
        rank(a).cmp(&rank(b)).then(width(a).total_cmp(&width(b)))
    };
    points
        .iter()
        .filter(|point| point.kind == StepKind::Point)
        .map(|point| {
            let is_unusable = !usable(point);
            repeats()
                .filter(|other| {
                    other.target == point.target && (is_unusable || other.kind == StepKind::Return)
                })
                .chain((!is_unusable).then_some(point))
                .min_by(order)
                .unwrap_or(point)
                .clone()
        })
        .collect()
}

fn usable(point: &IdentifiedPoint) -> bool {
    point.verdict != Verdict::Unusable && point.eta.is_some_and(f64::is_finite)
}

fn rank(point: &IdentifiedPoint) -> u8 {
    u8::from(point.verdict != Verdict::Good)
}

/// Width of the interval; infinite without one.
fn width(point: &IdentifiedPoint) -> f64 {
    match (point.eta_low, point.eta_high) {
        (Some(low), Some(high)) => high - low,
        _ => f64::INFINITY,
    }
}

/// A jump that the run made more than once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatedJump {
    /// Start of the jump.
    pub from: OperatingPoint,
    /// Target of the jump.
    pub to: OperatingPoint,
    /// Indices of the steps, from 0; files have their numbers, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub steps: Vec<usize>,
    /// Efficiency of each step, fraction.
    pub eta: Vec<f64>,
    /// Last minus first efficiency, fraction.
    pub eta_change: f64,
    /// Standard error of this change from noise, fraction; fixed offsets cancel. `None` if an interval is missing.
    pub eta_change_standard_error: Option<f64>,
}

/// Finds the repeated jumps, with the efficiency each time; a point that the same jump reached counts too.
pub fn repeated_jumps(markers: &[StepMarker], points: &[IdentifiedPoint]) -> Vec<RepeatedJump> {
    let mut jumps: Vec<(OperatingPoint, OperatingPoint)> = Vec::new();
    for marker in markers.iter().filter(|marker| marker.kind == StepKind::Repeat) {
        if let Some(jump) = marker.from.zip(marker.to).filter(|jump| !jumps.contains(jump)) {
            jumps.push(jump);
        }
    }
    jumps
        .into_iter()
        .filter_map(|(from, to)| {
            let steps = markers.iter().filter(|marker| (marker.from, marker.to) == (Some(from), Some(to)));
            let found: Vec<(&IdentifiedPoint, f64)> = steps
                .filter_map(|marker| {
                    let point = points.iter().find(|point| point.step == marker.index)?;
                    Some((point, point.eta?))
                })
                .collect();
            let ((first, first_eta), (last, last_eta)) = (found.first()?, found.last()?);
            let noise = |point: &IdentifiedPoint| Some(point.eta_uncertainty?.noise_standard_error);
            (found.len() > 1).then(|| RepeatedJump {
                from,
                to,
                steps: found.iter().map(|(point, _)| point.step).collect(),
                eta: found.iter().map(|(_, eta)| *eta).collect(),
                eta_change: last_eta - first_eta,
                eta_change_standard_error: noise(first)
                    .zip(noise(last))
                    .map(|(first, last)| first.hypot(last)),
            })
        })
        .collect()
}
