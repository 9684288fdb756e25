//! Selects the visit of each point that counts for the map: repeats serve the detection of drift.

use mapper_core::{IdentifiedPoint, StepKind, Verdict};

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
