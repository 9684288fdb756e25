//! Range and uncertainty of a map, in a few sentences.

use crate::formatting::duration::duration;
use mapper_campaign::Campaign;
use mapper_core::{CompressorMap, IdentifiedPoint, Plan, Verdict};
use mapper_numerics::statistics::median;
use mapper_recording::score::ScoredPoint;

/// Measured range, uncertainty and planned duration; `None` without a map.
pub fn key_figures(
    map: Option<&CompressorMap>,
    points: &[ScoredPoint],
    campaign: Option<&Campaign>,
    plan: Option<&Plan>,
) -> Option<String> {
    let (all, map) = (points.len(), map?);
    let units = campaign.map(|campaign| campaign.display.clone()).unwrap_or_default();
    let display = crate::Display::new(&units);
    let on_map: usize = map.lines.iter().map(|line| line.points.len()).sum();
    let speeds = || map.lines.iter().map(|line| line.speed_corrected_rpm);
    let slowest = display.speed(speeds().fold(f64::INFINITY, f64::min));
    let fastest = display.speed(speeds().fold(f64::NEG_INFINITY, f64::max));
    let mut words = match map.lines.len() {
        0 => return None,
        1 => format!("{on_map} points at {fastest} {} (corrected)", units.speed),
        lines => {
            format!(
                "{on_map} points on {lines} speed lines from {slowest} to {fastest} {} (corrected)",
                units.speed
            )
        }
    };
    match all.saturating_sub(on_map) {
        0 => {}
        1 => words.push_str(", one more visit to compare"),
        more => words.push_str(&format!(", {more} more visits to compare")),
    }
    words.push('.');
    if let Some(sure) = certainty(points.iter().map(|scored| &scored.point)) {
        words.push_str(&sure);
    }
    if let Some(plan) = plan {
        let rest_s = campaign.and_then(|campaign| campaign.zero).map_or(0.0, |zero| zero.duration_s);
        words.push_str(&format!(" Planned for {}", duration(rest_s + plan.duration_s())));
        if rest_s > 0.0 {
            words.push_str(&format!(", {} of it at rest", duration(rest_s)));
        }
        words.push('.');
    }
    Some(words)
}

/// Width of the intervals of usable points.
fn certainty<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Option<String> {
    let usable = points.filter(|point| point.verdict != Verdict::Unusable);
    let halves: Vec<f64> =
        usable.filter_map(|point| Some(50.0 * (point.eta_high? - point.eta_low?))).collect();
    let middle = median(halves.iter().copied())?;
    let widest = halves.iter().copied().fold(0.0, f64::max);
    Some(format!(
        " Efficiency is known within +/- {middle:.2} points (95 %) at half of the usable points, within +/- {widest:.2} at all of them."
    ))
}
