//! Trends of the nights: a panel per figure, a line per campaign and method.

use mapper_chart::{Axis, Colour, Figure as Picture, Line, Note, Panel, Scatter};
use mapper_history::{ListedRun, Metric, median};
use std::collections::{BTreeMap, BTreeSet};

/// Milliseconds of a day.
const MS_PER_DAY: f64 = 86_400_000.0;

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

/// Maximum number of dates under an axis.
const DATES_MAX: i64 = 6;

/// Equally spaced midnights from the first night to the last: days after the first night, and the formatted date.
fn dates(first_ms: i64, last_ms: i64) -> Vec<(f64, String)> {
    let day_ms = MS_PER_DAY as i64;
    let (first, last) = (first_ms.div_euclid(day_ms), last_ms.div_euclid(day_ms));
    let step = (last - first) / DATES_MAX + 1;
    let days = (0..=DATES_MAX).map(|i| first + i * step).take_while(|day| *day <= last);
    let format = if last - first > 360 { "%Y-%m-%d" } else { "%d %b" };
    days.map(|day| ((day * day_ms - first_ms) as f64 / MS_PER_DAY, crate::nights::time(day * day_ms, format)))
        // The first night's own midnight is before the axis.
        .map(|(place, text)| (place.max(0.0), text))
        .collect()
}

/// All figures as one SVG. The tooltip shows night, figure and value. A click opens the page that `report_of` names for a night that
/// began then, ms since 1970.
pub fn history_svg(
    runs: &[ListedRun],
    figures: &[Metric],
    report_of: impl Fn(i64) -> Option<String>,
) -> String {
    let first_ms = runs.iter().map(|listed| listed.night.started_ms).min().unwrap_or_default();
    let last_ms = runs.iter().map(|listed| listed.night.started_ms).max().unwrap_or_default();
    let day = |ms: i64| (ms - first_ms) as f64 / MS_PER_DAY;
    let lines: BTreeSet<(&str, &str)> = runs
        .iter()
        .map(|listed| (listed.run.key.campaign.as_str(), listed.run.key.method.as_str()))
        .collect();
    let since = jiff::Timestamp::from_millisecond(first_ms)
        .map_or_else(|_| String::new(), |time| time.strftime("%Y-%m-%d").to_string());
    let nights: BTreeSet<i64> = runs.iter().map(|listed| listed.night.id).collect();
    let mut picture = Picture::new("Nightly runs").subtitle(format!(
        "{} since {since}; medians over the seeds; rings: nights on which a figure left its band",
        if nights.len() == 1 { "1 night".to_owned() } else { format!("{} nights", nights.len()) }
    ));
    for figure in figures {
        let (unit, factor) = figure.display_unit();
        let mut panel = Panel::new(Axis::new("night (UTC)").ticks(dates(first_ms, last_ms)), Axis::new(unit))
            .title(format!("{}, {unit} ({figure})", figure.description()));
        let (mut rings, mut of_points) = (Vec::new(), Vec::new());
        for ((campaign, method), colour) in lines.iter().zip(COLOURS.iter().cycle()) {
            let mut nights: BTreeMap<(i64, i64), (bool, &str, Vec<f64>)> = BTreeMap::new();
            let of_line = |listed: &&ListedRun| {
                listed.run.key.campaign == *campaign && listed.run.key.method == *method
            };
            for listed in runs.iter().filter(of_line) {
                let night = nights.entry((listed.night.started_ms, listed.night.id)).or_insert((
                    listed.night.moved,
                    listed.night.program.as_str(),
                    Vec::new(),
                ));
                night.2.extend(listed.run.figures.get(figure));
            }
            let (mut places, mut notes) = (Vec::new(), Vec::new());
            for ((started_ms, _), (moved, program, mut values)) in nights {
                let Some(value) = median(&mut values) else { continue };
                places.push((day(started_ms), factor * value));
                let at = crate::nights::time(started_ms, "%Y-%m-%d %H:%M UTC");
                notes.push(Note {
                    text: format!(
                        "{at}; {campaign} {method}; {figure}: {:.4} {unit}{}; {program}",
                        factor * value,
                        if moved { "; a figure of this night moved" } else { "" }
                    ),
                    link: report_of(started_ms),
                });
                if moved {
                    rings.push((day(started_ms), factor * value));
                }
            }
            panel.add(Line::new(places.clone(), *colour).label(format!("{campaign} {method}")));
            of_points.push(Scatter::new(places, *colour).size_px(5.0).notes(notes));
        }
        if !rings.is_empty() {
            panel.add(Scatter::new(rings, MOVED).hollow().size_px(10.0).label("moved"));
        }
        // Last: an element above a point would keep the pointer from it.
        of_points.into_iter().for_each(|points| panel.add(points));
        picture = picture.panel(panel);
    }
    picture.to_svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_midnights_in_order_and_few() {
        let noon_ms = 20_000 * 86_400_000 + 43_200_000;
        let dates_for = |days: i64| dates(noon_ms, noon_ms + days * 86_400_000);
        assert_eq!(dates_for(0), [(0.0, "04 Oct".to_owned())]);
        assert_eq!(dates_for(2)[1..], [(0.5, "05 Oct".to_owned()), (1.5, "06 Oct".to_owned())]);
        for days in [0, 1, 5, 6, 7, 100, 10_000] {
            let dates = dates_for(days);
            assert!((1..=DATES_MAX as usize + 1).contains(&dates.len()), "{days}: {}", dates.len());
            assert!(dates.windows(2).all(|pair| pair[0].0 < pair[1].0), "{days}");
        }
        assert!(dates_for(10_000)[0].1.starts_with("2024-"), "a year where there are several");
    }
}
