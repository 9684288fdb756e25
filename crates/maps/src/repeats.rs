//! Which visits of a point stand for it on the map: repeats were made to see drift.

use mapper_core::{IdentifiedPoint, StepKind, Verdict};

/// The points that belong on the map, in their order: one for each step that was made for it.
///
/// A point without a usable efficiency gives its place to the repeat of the same target with the best verdict and, among
/// these, the smallest 95 % interval. The first point of a campaign has no jump before it: its efficiency, if it has
/// one, rests on what the points share (joint method). If it is visited again for its own sake, the better of the two
/// by the same rule is the point; the visits share offsets and law, so that a mean of both would promise too much.
pub fn points_for_map(points: &[IdentifiedPoint]) -> Vec<IdentifiedPoint> {
    let again = || {
        points.iter().filter(|point| point.kind != StepKind::Point && point.target.is_some() && usable(point))
    };
    let order = |a: &&IdentifiedPoint, b: &&IdentifiedPoint| {
        rank(a).cmp(&rank(b)).then(width(a).total_cmp(&width(b)))
    };
    points
        .iter()
        .filter(|point| point.kind == StepKind::Point)
        .map(|point| {
            let lost = !usable(point);
            again()
                .filter(|other| other.target == point.target && (lost || other.kind == StepKind::Return))
                .chain((!lost).then_some(point))
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
