//! Range and uncertainty of a map, the end of its run, and the sizes that its campaign assumes.

use crate::document::Document;
use crate::formatting::{Display, Message, duration, margins_text, significant_digits};
use mapper_campaign::{AssumedSize, Campaign, internal_area_sigma_ratio};
use mapper_core::{CompressorMap, IdentifiedPoint, Margins, Method, Plan, RunEnding, Trip, Verdict};
use mapper_numerics::statistics::median;
use mapper_recording::score::ScoredPoint;
use std::path::Path;

/// Measured range, uncertainty and planned duration; `None` without a map.
pub fn key_figures(
    map: Option<&CompressorMap>,
    points: &[ScoredPoint],
    campaign: Option<&Campaign>,
    plan: Option<&Plan>,
) -> Option<String> {
    let (all, map) = (points.len(), map?);
    let display = campaign.map_or_else(Display::default, |campaign| Display::new(&campaign.display));
    let unit = &display.units.speed;
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

fn certainty<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Option<String> {
    let usable = points.filter(|point| point.verdict != Verdict::Unusable);
    let all: Vec<Margins> = usable.filter_map(|point| Some(point.eta_margins_95()?.scaled(100.0))).collect();
    let middle = Margins {
        below: median(all.iter().map(|margins| margins.below))?,
        above: median(all.iter().map(|margins| margins.above))?,
    };
    let widest = Margins {
        below: all.iter().map(|margins| margins.below).fold(0.0, f64::max),
        above: all.iter().map(|margins| margins.above).fold(0.0, f64::max),
    };
    let within = |margins: Margins| {
        let sign = if margins.is_symmetric() { "+/- " } else { "" };
        format!("{sign}{}", margins_text(margins, 1))
    };
    Some(format!(
        " Its efficiencies are known within {} points (95 %) at half of the usable points, within {} at all of them.",
        within(middle),
        within(widest)
    ))
}

/// Where the points of a report come from.
#[derive(Debug, Clone, PartialEq)]
pub enum PointsOrigin {
    /// A run.
    Run(RunEnding),
    /// Recordings.
    Recordings(Method),
}

impl PointsOrigin {
    pub(crate) fn is_complete(&self) -> bool {
        !matches!(self, PointsOrigin::Run(ending) if *ending != RunEnding::Completed)
    }

    pub(crate) fn sentence(&self) -> String {
        match self {
            PointsOrigin::Run(ending) => ending.message(),
            PointsOrigin::Recordings(method) => format!("Identified by the method `{method}`."),
        }
    }
}

impl Message for RunEnding {
    fn message(&self) -> String {
        let stop = match self {
            RunEnding::Completed => return "Completed.".to_owned(),
            RunEnding::Drifted { reason } => format!("({reason})"),
            RunEnding::Interrupted { t_s } => format!("by the operator at {t_s:.0} s"),
            RunEnding::Tripped(Trip { t_s, reason, .. }) => format!("by a guard at {t_s:.1} s ({reason})"),
            // A script's error shows its source line below the first line.
            RunEnding::Failed { reason } => {
                format!("by a fault ({})", reason.lines().next().unwrap_or_default())
            }
        };
        format!("Stopped {stop}: the map is not complete.")
    }
}

pub(crate) fn assumed_sentence(campaign: &Campaign) -> Option<String> {
    sentence_with(campaign, |size| size.name)
}

fn sentence_with(campaign: &Campaign, name: fn(&AssumedSize) -> &str) -> Option<String> {
    let sizes = &campaign.machine.assumed;
    if sizes.is_empty() {
        return None;
    }
    let named: Vec<String> = sizes.iter().map(|size| size_text(name(size), size)).collect();
    let wheel_mm = 1e3 * campaign.machine.params.compressor.wheel_diameter_m;
    let sigma_ratio = internal_area_sigma_ratio(sizes);
    let widened = if sigma_ratio > 0.0 {
        format!(
            "; the intervals of h include an uncertainty of {:.0} % (1 sigma) of the internal area of the compressor",
            100.0 * sigma_ratio
        )
    } else {
        String::new()
    };
    Some(format!(
        "assumed, from the machine of Burke et al. scaled to a wheel of {} mm: {}{widened}",
        significant_digits(wheel_mm, 3),
        named.join(", ")
    ))
}

pub(crate) fn assumed_keys(campaign: &Campaign) -> Option<String> {
    sentence_with(campaign, |size| &size.key)
}

/// The files of a first campaign, and the next commands.
pub fn first_campaign(
    campaign: &Path,
    map: &Path,
    channels: Option<&Path>,
    points: usize,
    assumed: &[AssumedSize],
) -> Document {
    let mut document = Document::default();
    let mut files = vec![
        ("campaign", format!("{} ({points} points)", campaign.display())),
        ("map", map.display().to_string()),
    ];
    files.extend(channels.map(|channels| ("channels", channels.display().to_string())));
    document.facts("", files);
    document.text(format!(
        "{} sizes of the machine are assumed from its wheel: they are listed in the campaign as comments. Correct the ones that you know.",
        assumed.len()
    ));
    document.text(format!("Next: mapper check {}", campaign.display()));
    document
}

fn size_text(name: &str, size: &AssumedSize) -> String {
    let unit = if size.unit.is_empty() { String::new() } else { format!(" {}", size.unit) };
    format!("{name} {}{unit}", significant_digits(size.value, 3))
}
