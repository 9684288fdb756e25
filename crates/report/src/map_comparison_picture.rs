//! Two maps and their difference as a picture.

use mapper_chart::{
    Axis, Figure, Line, LineEnd, Marker, Panel, Rule, RuleAt, Scatter, ScatterPoint, palette,
};
use mapper_core::{CompressorMap, half_width_95};
use mapper_maps::{MapComparison, PlaceComparison};
use std::path::Path;

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
    for line in &comparison.lines {
        let speed = format!("{:.0}", line.speed_corrected_rpm / 1000.0);
        let places: Vec<(f64, f64)> =
            line.places.iter().map(|p| (p.flow_corrected_kg_s, p.pressure_ratio)).collect();
        panel.add(Line::new(places, palette::GREY).width_px(1.2).end_label(speed, LineEnd::First));
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
    let mut panel =
        Panel::new(Axis::new("corrected mass flow, kg/s"), Axis::new("difference of efficiency, points"))
            .title("(b) efficiency, second minus first, with its 95 % interval")
            .with(Rule::new(RuleAt::Y(0.0)));
    let last = comparison.lines.len().saturating_sub(1).max(1) as f64;
    for (index, line) in comparison.lines.iter().enumerate() {
        let colour = palette::sequential(index as f64 / last);
        let points: Vec<ScatterPoint> = line
            .places
            .iter()
            .enumerate()
            .map(|(place, p)| {
                let (y, half) = (100.0 * p.eta_difference, 100.0 * half_width_95(p.eta_standard_error));
                // Bars vary slowly along a line: a few of them, at different places of each line, stay legible.
                let y_interval = (place % BAR_EVERY == index % BAR_EVERY).then_some((y - half, y + half));
                ScatterPoint { x: p.flow_corrected_kg_s, y, x_interval: None, y_interval }
            })
            .collect();
        let label = format!("{:.0} krpm", line.speed_corrected_rpm / 1000.0);
        panel.add(Line::new(points.iter().map(|p| (p.x, p.y)).collect(), colour).label(&label));
        panel.add(Scatter::new(points, colour).size_px(5.0).label(&label));
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::distinct_names;
    use std::path::Path;

    #[test]
    fn a_legend_tells_two_files_apart() {
        let names = |a: &str, b: &str| distinct_names([Path::new(a), Path::new(b)]);
        assert_eq!(names("runs/a/map.json", "runs/b/map.json"), ["a/map.json", "b/map.json"]);
        assert_eq!(names("a/x.csv", "b/y.csv"), ["x.csv", "y.csv"]);
        assert_eq!(names("map.json", "b/map.json"), ["map.json", "b/map.json"]);
        assert_eq!(names("a/map.json", "a/map.json"), ["a/map.json", "a/map.json again"]);
    }
}
