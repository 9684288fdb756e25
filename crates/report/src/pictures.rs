//! Pictures of results: h over flow, error of efficiency over the change of T2, two maps compared, trends of the nightly runs.

use mapper_chart::{
    Axis, Colour, Dash, Figure, Figure as Picture, Line, LineEnd, MapDrawing, Marker, Note, Panel, Rule,
    RuleAt, Scatter, ScatterPoint, palette,
};
use mapper_core::{CompressorMap, IdentifiedPoint, Verdict, half_width_95};
use mapper_history::{ListedRun, Metric, median};
use mapper_maps::{MapComparison, PlaceComparison, SpeedLineComparison};
use mapper_recording::score::ScoredPoint;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// h of every point over flow with its interval, and the law `h ~ flow^exponent` through the good points' median.
pub fn heat_transfer_figure(machine: &str, points: &[IdentifiedPoint], exponent: f64) -> Figure {
    let mut panel = Panel::new(Axis::new("mass flow, kg/s"), Axis::new("h, W/(m2 K)"));
    let known = || points.iter().filter(|p| p.verdict != Verdict::Unusable && p.flow_kg_s > 0.0);
    let mut factors: Vec<f64> = known()
        .filter(|p| p.verdict == Verdict::Good)
        .filter_map(|p| Some(p.h_w_m2k? / p.flow_kg_s.powf(exponent)))
        .filter(|factor| factor.is_finite())
        .collect();
    factors.sort_by(f64::total_cmp);
    let flows = || known().map(|p| p.flow_kg_s);
    let (low, high) = flows().fold((f64::INFINITY, 0.0f64), |r, v| (r.0.min(v), r.1.max(v)));
    if let Some(factor) = factors.get(factors.len() / 2) {
        let law = (0..=60)
            .map(|i| low + (high - low) * f64::from(i) / 60.0)
            .map(|flow| (flow, factor * flow.powf(exponent)))
            .collect();
        panel.add(Line::new(law, palette::INK).label(format!("law, flow to the power of {exponent:.3}")));
    }
    let shown = known().filter_map(|p| {
        let y_interval = p.h_low_w_m2k.zip(p.h_high_w_m2k);
        Some((p.verdict, ScatterPoint { x: p.flow_kg_s, y: p.h_w_m2k?, x_interval: None, y_interval }))
    });
    add_by_verdict(&mut panel, &shown.collect::<Vec<_>>());
    figure_of(panel, format!("Heat transfer between gas and compressor housing of {}", named(machine)))
        .subtitle("Points with their 95 % intervals; the law goes through the good points' median.")
}

/// Error of efficiency over the change of T2, as in figure 12 of the paper, for simulated runs, whose truth is known; `None` without truth.
pub fn error_figure(machine: &str, points: &[ScoredPoint]) -> Option<Figure> {
    let errors: Vec<(Verdict, ScatterPoint)> = points
        .iter()
        .filter_map(|ScoredPoint { point, truth }| {
            let y = 100.0 * (point.eta? - truth.as_ref()?.eta);
            let half = point.eta_low.zip(point.eta_high).map(|(low, high)| 100.0 * (0.5 * (high - low)));
            let y_interval = half.map(|half| (y - half, y + half));
            Some((point.verdict, ScatterPoint { x: point.dt2_k?, y, x_interval: None, y_interval }))
        })
        .collect();
    if errors.is_empty() {
        return None;
    }
    let mut panel =
        Panel::new(Axis::new("change of T2 in the window, K"), Axis::new("error of efficiency, points"))
            .with(Rule::new(RuleAt::Y(0.0)));
    for at in [-1.0, 1.0] {
        panel.add(Rule { dash: Dash::Dotted, ..Rule::new(RuleAt::Y(at)).label("1 point") });
    }
    add_by_verdict(&mut panel, &errors);
    Some(figure_of(panel, format!("Error of efficiency over the change of T2, {}", named(machine)))
        .subtitle("Against the simulator's truth; bars are the 95 % intervals that the identification gives, cut at the frame."))
}

pub(crate) fn add_by_verdict(panel: &mut Panel, points: &[(Verdict, ScatterPoint)]) {
    for (verdict, colour, marker, name) in [
        (Verdict::Good, palette::BLUE, Marker::Circle, "good"),
        (Verdict::Doubtful, palette::VERMILLION, Marker::Diamond, "doubtful"),
    ] {
        let members: Vec<ScatterPoint> =
            points.iter().filter(|(of_point, _)| *of_point == verdict).map(|(_, point)| *point).collect();
        if !members.is_empty() {
            panel.add(Scatter::new(members, colour).marker(marker).label(name));
        }
    }
}

fn named(machine: &str) -> &str {
    if machine.is_empty() { "unnamed machine" } else { machine }
}

fn figure_of(panel: Panel, title: String) -> Figure {
    Figure::new(title).panel(panel).columns(1).panel_size_px(640.0, 420.0)
}

/// Number of places per error bar in the second panel.
const BAR_EVERY: usize = 5;

/// Names of two files for a legend, with as many of their folders as needed to distinguish them.
pub fn distinct_names(files: [&Path; 2]) -> [String; 2] {
    let last = |path: &Path, count: usize| {
        let parts: Vec<String> =
            path.iter().rev().take(count).map(|part| part.to_string_lossy().into_owned()).collect();
        parts.into_iter().rev().collect::<Vec<_>>().join("/")
    };
    let longest = files.map(|path| path.iter().count()).into_iter().max().unwrap_or(1).max(1);
    let names = (1..=longest).map(|count| files.map(|path| last(path, count)));
    let [first, second] = names
        .into_iter()
        .find(|[first, second]| first != second)
        .unwrap_or_else(|| files.map(|path| path.display().to_string()));
    // A file compared with itself has one name.
    if first == second { [first, format!("{second} again")] } else { [first, second] }
}

/// The measured lines of several maps at the reference state of the first, each with its own colour and dash, and their efficiencies.
pub fn maps_figure(maps: &[CompressorMap], names: &[&str]) -> Figure {
    const DASHES: [Dash; 4] = [Dash::Solid, Dash::Dashed, Dash::Dotted, Dash::DashDot];
    let flow = || Axis::new("corrected mass flow, kg/s");
    let mut course = Panel::new(flow(), Axis::new("total pressure ratio P2/P1")).title("(a) speed lines");
    let mut efficiency =
        Panel::new(flow(), Axis::new("efficiency, %")).title("(b) efficiency on the speed lines");
    let reference = maps.first().map(|map| map.reference);
    for (index, (map, name)) in maps.iter().zip(names).enumerate() {
        let map = reference.map_or_else(|| map.clone(), |reference| map.clone().at_reference(reference));
        let line = |points| {
            let dash = DASHES[index % DASHES.len()];
            Line::new(points, COLOURS[index % COLOURS.len()]).dash(dash).label(*name)
        };
        for drawn in MapDrawing::new(&map).lines.iter().filter(|line| line.measured) {
            let within = drawn.nodes.iter().filter(|node| !node.extrapolated).map(|node| node.place);
            let speed = format!("{:.0}", drawn.speed_corrected_rpm / 1000.0);
            let course_line = line(within.collect());
            course.add(if index == 0 { course_line.end_label(speed, LineEnd::First) } else { course_line });
            efficiency
                .add(line(drawn.eta.iter().map(|at| (at.flow_corrected_kg_s, 100.0 * at.eta)).collect()));
        }
    }
    let subtitle = reference.map(|state| format!("Corrected to {state}; numbers are speeds in krpm."));
    let figure = Figure::new("Maps of the runs").subtitle(subtitle.unwrap_or_default());
    figure.panel(course).panel(efficiency).panel_size_px(560.0, 460.0)
}

/// Points of both maps with the compared places, and the difference of efficiency with its 95 % interval.
pub fn map_comparison_figure(
    first: &CompressorMap,
    second: &CompressorMap,
    comparison: &MapComparison,
    names: &[String; 2],
) -> Figure {
    let second = second.clone().at_reference(first.reference);
    Figure::new("Comparison of two maps")
        .subtitle(format!(
            "{} minus {}; both corrected to {}. Lines differ beyond their uncertainty at {:.0} % of places, efficiencies at {:.0} %.",
            names[1],
            names[0],
            first.reference,
            100.0 * comparison.line_differs_ratio,
            100.0 * comparison.eta_differs_ratio
        ))
        .panel(map_panel(first, &second, comparison, names))
        .panel(eta_panel(comparison))
        .panel_size_px(560.0, 460.0)
}

fn map_panel(
    first: &CompressorMap,
    second: &CompressorMap,
    comparison: &MapComparison,
    names: &[String; 2],
) -> Panel {
    let mut panel =
        Panel::new(Axis::new("corrected mass flow, kg/s"), Axis::new("total pressure ratio P2/P1"))
            .title("(a) points of both; lines of the second, coloured where they differ");
    for line in &second.lines {
        let speed = format!("{:.0}", line.speed_corrected_rpm / 1000.0);
        let points = line.points.iter().map(|p| (p.flow_corrected_kg_s, p.pressure_ratio)).collect();
        panel.add(Line::new(points, palette::GREY).width_px(1.2).end_label(speed, LineEnd::Last));
    }
    for line in &comparison.lines {
        let differs = |p: &PlaceComparison| p.line_differs() || p.eta_differs();
        // A place without a difference interrupts the coloured line.
        let coloured: Vec<(f64, f64)> = line
            .places
            .iter()
            .map(
                |p| if differs(p) { (p.flow_corrected_kg_s, p.pressure_ratio) } else { (f64::NAN, f64::NAN) },
            )
            .collect();
        panel.add(
            Line::new(coloured, palette::VERMILLION).width_px(2.6).label("differs beyond its 95 % interval"),
        );
    }
    for (map, colour, marker, name) in [
        (first, palette::INK, Marker::Circle, &names[0]),
        (second, palette::BLUE, Marker::Diamond, &names[1]),
    ] {
        let points: Vec<(f64, f64)> = map
            .lines
            .iter()
            .flat_map(|line| &line.points)
            .map(|p| (p.flow_corrected_kg_s, p.pressure_ratio))
            .collect();
        panel.add(Scatter::new(points, colour).marker(marker).hollow().size_px(6.0).label(name));
    }
    panel
}

fn eta_panel(comparison: &MapComparison) -> Panel {
    let of_line = |(index, line): (usize, &SpeedLineComparison)| -> Vec<ScatterPoint> {
        line.places
            .iter()
            .enumerate()
            .map(|(place, p)| {
                let (y, half) = (100.0 * p.eta_difference, 100.0 * half_width_95(p.eta_standard_error));
                // Bars vary slowly along a line: a few of them, at different places of each line, stay legible.
                let y_interval = (place % BAR_EVERY == index % BAR_EVERY).then_some((y - half, y + half));
                ScatterPoint { x: p.flow_corrected_kg_s, y, x_interval: None, y_interval }
            })
            .collect()
    };
    let lines: Vec<Vec<ScatterPoint>> = comparison.lines.iter().enumerate().map(of_line).collect();
    // The axis has all bars: a difference is judged by them.
    let ends = lines.iter().flatten().map(|point| point.y_interval.unwrap_or((point.y, point.y)));
    // Without lines both are NaN, and the axis follows the data.
    let (low, high) =
        ends.fold((f64::NAN, f64::NAN), |ends, (low, high)| (ends.0.min(low), ends.1.max(high)));
    let axis = Axis::new("difference of efficiency, points").range(low, high);
    let mut panel = Panel::new(Axis::new("corrected mass flow, kg/s"), axis)
        .title("(b) efficiency, second minus first, with its 95 % interval")
        .with(Rule::new(RuleAt::Y(0.0)));
    let last = lines.len().saturating_sub(1).max(1) as f64;
    for (index, (line, points)) in comparison.lines.iter().zip(lines).enumerate() {
        let colour = palette::sequential(index as f64 / last);
        let label = format!("{:.0} krpm", line.speed_corrected_rpm / 1000.0);
        panel.add(Line::new(points.iter().map(|p| (p.x, p.y)).collect(), colour).label(&label));
        panel.add(Scatter::new(points, colour).size_px(5.0).label(&label));
    }
    panel
}

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

/// All figures as one SVG with tooltips. A click opens the page that `report_of` names for a night that began then, ms since 1970.
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
    fn a_legend_tells_two_files_apart() {
        let names = |a: &str, b: &str| distinct_names([Path::new(a), Path::new(b)]);
        assert_eq!(names("runs/a/map.json", "runs/b/map.json"), ["a/map.json", "b/map.json"]);
        assert_eq!(names("a/x.csv", "b/y.csv"), ["x.csv", "y.csv"]);
        assert_eq!(names("map.json", "b/map.json"), ["map.json", "b/map.json"]);
        assert_eq!(names("a/map.json", "a/map.json"), ["a/map.json", "a/map.json again"]);
    }

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
