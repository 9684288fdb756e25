//! Trends of the nights: a panel a figure, a line a campaign and method.

use mapper_chart::{Axis, Colour, Figure as Picture, Line, Panel, Scatter};
use mapper_history::{ListedRun, Metric, median};
use std::collections::{BTreeMap, BTreeSet};

const COLOURS: [Colour; 8] = [
    Colour(0x1D, 0x4E, 0x89),
    Colour(0xB4, 0x53, 0x09),
    Colour(0x2E, 0x7D, 0x32),
    Colour(0x8E, 0x24, 0xAA),
    Colour(0xC6, 0x28, 0x28),
    Colour(0x00, 0x83, 0x8F),
    Colour(0x6D, 0x4C, 0x41),
    Colour(0x45, 0x4F, 0x5B),
];
const MOVED: Colour = Colour(0xC6, 0x28, 0x28);
const MS_PER_DAY: f64 = 86_400_000.0;

/// All figures as one SVG.
pub fn history_svg(runs: &[ListedRun], figures: &[Metric]) -> String {
    let first_ms = runs.iter().map(|listed| listed.night.started_ms).min().unwrap_or_default();
    let day = |ms: i64| (ms - first_ms) as f64 / MS_PER_DAY;
    let lines: BTreeSet<(&str, &str)> = runs
        .iter()
        .map(|listed| (listed.run.key.campaign.as_str(), listed.run.key.method.as_str()))
        .collect();
    let since = jiff::Timestamp::from_millisecond(first_ms)
        .map_or_else(|_| String::new(), |time| time.strftime("%Y-%m-%d").to_string());
    let nights: BTreeSet<i64> = runs.iter().map(|listed| listed.night.id).collect();
    let mut picture = Picture::new("Nightly runs").subtitle(format!(
        "{} nights since {since}; medians over the seeds; rings: nights on which a figure left its band",
        nights.len()
    ));
    for figure in figures {
        let (unit, factor) = figure.shown_unit();
        let mut panel =
            Panel::new(Axis::new("days since the first night"), Axis::new(format!("{figure}, {unit}")))
                .title(figure.name());
        let mut rings = Vec::new();
        for ((campaign, method), colour) in lines.iter().zip(COLOURS.iter().cycle()) {
            let mut nights: BTreeMap<(i64, i64), (bool, Vec<f64>)> = BTreeMap::new();
            let of_line = |listed: &&ListedRun| {
                listed.run.key.campaign == *campaign && listed.run.key.method == *method
            };
            for listed in runs.iter().filter(of_line) {
                let night = nights
                    .entry((listed.night.started_ms, listed.night.id))
                    .or_insert((listed.night.moved, Vec::new()));
                night.1.extend(listed.run.figures.get(figure));
            }
            let mut places = Vec::new();
            for ((started_ms, _), (moved, mut values)) in nights {
                let Some(value) = median(&mut values) else { continue };
                places.push((day(started_ms), factor * value));
                if moved {
                    rings.push((day(started_ms), factor * value));
                }
            }
            panel.add(Line::new(places.clone(), *colour).label(format!("{campaign} {method}")));
            panel.add(Scatter::new(places, *colour).size_px(4.0));
        }
        if !rings.is_empty() {
            panel.add(Scatter::new(rings, MOVED).hollow().size_px(10.0).label("moved"));
        }
        picture = picture.panel(panel);
    }
    picture.to_svg()
}
