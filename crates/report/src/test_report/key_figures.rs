//! Range and uncertainty of a map, in a few sentences.

use crate::formatting::display::Display;
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
    let display = campaign.map_or_else(Display::default, |campaign| Display::new(&campaign.display));
    let unit = &display.units().speed;
    let on_map: usize = map.lines.iter().map(|line| line.points.len()).sum();
    let speeds = || map.lines.iter().map(|line| line.speed_corrected_rpm);
    let slowest = display.line_name(speeds().fold(f64::INFINITY, f64::min));
    let fastest = display.line_name(speeds().fold(f64::NEG_INFINITY, f64::max));
    let measured = map.lines.iter().flat_map(|line| &line.points);
    let highest = measured.map(|point| point.pressure_ratio).fold(f64::NEG_INFINITY, f64::max);
    let mut phrases = match map.lines.len() {
        0 => return None,
        1 => format!("The map has {on_map} points at {fastest} {unit} (corrected)"),
        lines => {
            format!(
                "The map has {on_map} points on {lines} speed lines from {slowest} to {fastest} {unit} (corrected)"
            )
        }
    };
    phrases.push_str(&format!(", with pressure ratios up to {highest:.2}."));
    match all.saturating_sub(on_map) {
        0 => {}
        1 => phrases.push_str(" One more point was measured to show drift."),
        more => phrases.push_str(&format!(" {more} more points were measured to show drift.")),
    }
    let usable = |point: &&IdentifiedPoint| point.verdict != Verdict::Unusable;
    let best = points.iter().map(|scored| &scored.point).filter(usable);
    if let Some((best, eta)) =
        best.filter_map(|point| Some((point, point.eta?))).max_by(|a, b| a.1.total_cmp(&b.1))
    {
        phrases.push_str(&format!(
            " The best efficiency is {:.1} %, at {} {unit} and a pressure ratio of {:.2}.",
            100.0 * eta,
            display.line_name(best.speed_corrected_rpm),
            best.pressure_ratio
        ));
    }
    if let Some(sure) = certainty(points.iter().map(|scored| &scored.point)) {
        phrases.push_str(&sure);
    }
    if let Some(plan) = plan {
        let rest_s = campaign.and_then(|campaign| campaign.zero).map_or(0.0, |zero| zero.duration_s);
        phrases.push_str(&format!(" The test was planned for {}", duration(rest_s + plan.duration_s())));
        if rest_s > 0.0 {
            phrases.push_str(&format!(", {} of it at rest", duration(rest_s)));
        }
        phrases.push('.');
    }
    Some(phrases)
}

/// Width of the intervals of usable points.
fn certainty<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Option<String> {
    let usable = points.filter(|point| point.verdict != Verdict::Unusable);
    let halves: Vec<f64> =
        usable.filter_map(|point| Some(50.0 * (point.eta_high? - point.eta_low?))).collect();
    let median_half_width = median(halves.iter().copied())?;
    let widest = halves.iter().copied().fold(0.0, f64::max);
    Some(format!(
        " Its efficiencies are known within +/- {median_half_width:.1} points (95 %) at half of the usable points, within +/- {widest:.1} at all of them."
    ))
}
