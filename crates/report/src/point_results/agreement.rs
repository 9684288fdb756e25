//! Whether two methods agree at a point, and the share of the errors that all points have in common.

use crate::formatting::Display;
use mapper_core::{IdentifiedPoint, Verdict, half_width_95, step_number};
use mapper_identify::DynamicEfficiency;
use mapper_numerics::statistics::median;
use mapper_recording::score::ScoredPoint;

/// One sentence on the points whose 95 % intervals by both methods do not overlap; `None` if all overlap.
pub fn disagreement_text(
    points: &[ScoredPoint],
    dynamic: &[DynamicEfficiency],
    display: &Display,
) -> Option<String> {
    let pairs = dynamic.iter().filter_map(|other| {
        let point = points.iter().map(|scored| &scored.point).find(|point| point.step == other.step)?;
        Some((point, other, distance(point, other)?))
    });
    let pairs: Vec<_> = pairs.collect();
    let disagreeing: Vec<_> = pairs.iter().filter(|(point, other, _)| are_disjoint(point, other)).collect();
    let (point, other, distance) = disagreeing.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some(format!(
        "Methods disagree: at {} of {} points the efficiency by `dynamic` lies outside both 95 % intervals of the one by `joint`, by up \
         to {:.1} points (step {}, {} {}, opening {}: {:.1} % against {:.1} %). `dynamic` takes alpha_A and the probe as declared and h \
         as constant in each step; `joint` finds them from all steps.\n",
        disagreeing.len(),
        pairs.len(),
        100.0 * distance,
        step_number(point.step),
        display.speed(point.speed_rpm),
        display.units().speed,
        crate::point_results::points::opening(point.valve_opening_ratio),
        100.0 * other.eta,
        100.0 * point.eta.unwrap_or(f64::NAN),
    ))
}

fn distance(point: &IdentifiedPoint, other: &DynamicEfficiency) -> Option<f64> {
    Some((point.eta? - other.eta).abs())
}

fn are_disjoint(point: &IdentifiedPoint, other: &DynamicEfficiency) -> bool {
    let (Some(low), Some(high)) = (point.eta_low, point.eta_high) else { return false };
    other.eta_high < low || high < other.eta_low
}

/// One sentence for the slowest speed and the others, because the effect of offsets decreases with the square of the speed; `None` if no
/// point has an interval with a common part.
pub fn shared_errors_text<'a>(
    points: impl Iterator<Item = &'a IdentifiedPoint>,
    display: &Display,
) -> Option<String> {
    let usable: Vec<&IdentifiedPoint> = points
        .filter(|point| point.verdict != Verdict::Unusable && point.eta_low.is_some())
        .filter(|point| !point.common.eta_changes.is_empty())
        .collect();
    let speed = |point: &IdentifiedPoint| point.target.map_or(point.speed_rpm, |target| target.speed_rpm);
    let slowest_rpm = usable.iter().map(|point| speed(point)).reduce(f64::min)?;
    // The speed along a line varies by a few per cent at most.
    let (slow, fast): (Vec<&IdentifiedPoint>, Vec<&IdentifiedPoint>) =
        usable.iter().copied().partition(|point| speed(point) <= 1.05 * slowest_rpm);
    let describe = |points: &[&IdentifiedPoint]| {
        let half = |value: fn(&IdentifiedPoint) -> Option<f64>| {
            median(points.iter().filter_map(|point| value(point))).map(|x| 100.0 * x)
        };
        let total = half(|point| Some(0.5 * (point.eta_high? - point.eta_low?)))?;
        let common = half(|point| Some(half_width_95(point.common.eta_standard_error())))?;
        Some(format!("{common:.2} of a half width of {total:.2} points"))
    };
    let first = format!("{} at {} {}", describe(&slow)?, display.speed(slowest_rpm), display.units().speed);
    let parts = match describe(&fast) {
        Some(others) => format!("{first} and {others} above"),
        None => first,
    };
    Some(format!(
        "Common to all points (offsets, gains and shared parameters of the method, with the same error at every point): {parts}; in \
         quadrature, the remainder is independent for each point. The map's files have both parts."
    ))
}
