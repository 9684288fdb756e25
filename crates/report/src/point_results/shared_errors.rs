//! The share of the points' intervals that is common to all of them, in a sentence.

use crate::formatting::display::Display;
use mapper_core::{IdentifiedPoint, Verdict, half_width_95};
use mapper_numerics::statistics::median;

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
