//! Repeats were made to see drift: they are not points of the map.

use mapper_core::{IdentifiedPoint, StepKind, Verdict};

/// The points that belong on the map, in their order: one for each step that was made for it.
///
/// A point without a usable efficiency (the first of a campaign has no jump before it) gives its place to the repeat of
/// the same target with the best verdict and, among these, the smallest 95 % interval.
pub fn points_for_map(points: &[IdentifiedPoint]) -> Vec<IdentifiedPoint> {
    let repeats = || {
        points
            .iter()
            .filter(|point| point.kind == StepKind::Repeat && point.target.is_some() && usable(point))
    };
    points
        .iter()
        .filter(|point| point.kind == StepKind::Point)
        .map(|point| {
            let stands_in = (!usable(point))
                .then(|| {
                    repeats()
                        .filter(|repeat| repeat.target == point.target)
                        .min_by(|a, b| rank(a).cmp(&rank(b)).then(width(a).total_cmp(&width(b))))
                })
                .flatten();
            stands_in.unwrap_or(point).clone()
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
