//! Disagreement of the joint and the dynamic method: the most important warning for a reader.

use crate::formatting::display::Display;
use mapper_core::{IdentifiedPoint, step_number};
use mapper_identify::DynamicEfficiency;
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
