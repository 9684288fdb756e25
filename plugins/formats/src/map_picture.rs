//! The map as a picture: (a) pressure ratio over flow with efficiency contours, (b) efficiency over flow.
//!
//! The marker size in (a) shows the uncertainty of a point, in classes of its 95 % interval (text would cover the
//! map), and (b) shows the interval itself as a bar. Shape and colour distinguish good from doubtful; points without
//! an efficiency are hollow.

use crate::fitted_items;
use crate::heading::efficiency_name;
use crate::labels::{percent, speed};
use mapper_chart::efficiency_mesh::{contour_levels, efficiency_surface, points_surge_to_choke, speed_curve};
use mapper_chart::{Axis, Contours, Figure, Line, LineEnd, Marker, Panel, Scatter, ScatterPoint, palette};
use mapper_core::{CompressorMap, MapPoint, MapUnits, Method, SurgeMark, Verdict, confidence_interval_95};

/// The map as a figure of two panels in these units, efficiency in %.
pub fn map_figure(map: &CompressorMap, units: &MapUnits) -> Figure {
    let points = map.lines.iter().map(|line| line.points.len()).sum::<usize>();
    let machine = if map.machine.is_empty() { "unnamed machine" } else { &map.machine };
    Figure::new(format!("Compressor map of {machine}"))
        .subtitle(format!(
            "Corrected to {}. Method: {} (isentropic efficiency total to total, {}{}).{} {points} points on {} speed lines; {}.",
            map.reference,
            map.method,
            efficiency_name(map.method),
            map.efficiency.map(|definition| format!("; {}", definition.description())).unwrap_or_default(),
            map.gas.as_ref().map(|gas| format!(" Gas: {gas}.")).unwrap_or_default(),
            map.lines.len(),
            match &map.fitted {
                None => "contours between measured points only".to_owned(),
                Some(fitted) => format!(
                    "lines and contours are fitted to all of them (scatter {:.1} % of distance, {:.1} points of efficiency)",
                    100.0 * fitted.distance_rms_ratio,
                    100.0 * fitted.eta_rms
                ),
            },
        ))
        .panel(map_panel(map, units))
        .panel(efficiency_panel(map, units))
        .panel_size_px(560.0, 460.0)
}

/// Corrected flow in display units; items of a panel are in kg/s.
fn flow_axis(units: &MapUnits) -> Axis {
    Axis::new(format!("corrected mass flow, {}", units.flow)).written_times(units.flow_of_one_kg_s)
}

/// Panel (a): items in kg/s and pressure ratio.
fn map_panel(map: &CompressorMap, units: &MapUnits) -> Panel {
    let mut panel = Panel::new(flow_axis(units), Axis::new("total pressure ratio P2/P1"))
        .title(format!("(a) speed lines ({}, corrected) and efficiency contours (%)", units.speed));
    match &map.fitted {
        Some(fitted) => fitted_items::add_map(&mut panel, fitted, units),
        None => add_measured_lines(&mut panel, map, units),
    }
    if !map.surge.is_empty() {
        panel.add(surge_marks(map));
    }
    let all = || map.lines.iter().flat_map(|line| &line.points);
    for class in CLASSES {
        let members: Vec<(f64, f64)> = all()
            .filter(|point| class.holds(point))
            .map(|point| (point.flow_corrected_kg_s, point.pressure_ratio))
            .collect();
        if !members.is_empty() {
            panel.add(class.scatter(members).label(class.label));
        }
    }
    panel
}

/// Measured surge-side ends, with their 95 % intervals.
fn surge_marks(map: &CompressorMap) -> Scatter {
    let mark = |mark: &SurgeMark| {
        let (flow, ratio) = (mark.flow_corrected_kg_s, mark.pressure_ratio);
        ScatterPoint {
            x: flow,
            y: ratio,
            x_interval: Some(confidence_interval_95(flow, mark.flow_total_standard_error_kg_s())),
            y_interval: Some(confidence_interval_95(ratio, mark.pressure_ratio_standard_error)),
        }
    };
    let marks: Vec<ScatterPoint> = map.surge.iter().map(mark).collect();
    Scatter::new(marks, palette::VERMILLION).marker(Marker::Square).label("surge, sought")
}

/// Lines and contours through the points, without a fit.
fn add_measured_lines(panel: &mut Panel, map: &CompressorMap, units: &MapUnits) {
    if let Some(grid) = efficiency_surface(map) {
        let levels = contour_levels(grid.value_range());
        panel.add(Contours::new(grid, &levels, percent));
    }
    for line in &map.lines {
        let curve = speed_curve(map, line);
        let speed = speed(line.speed_corrected_rpm, units);
        panel.add(Line::new(curve, palette::INK).width_px(1.3).end_label(speed, LineEnd::Last));
    }
}

fn efficiency_panel(map: &CompressorMap, units: &MapUnits) -> Panel {
    let name = match map.method {
        Method::Steady => "apparent efficiency, %",
        Method::Dynamic | Method::Joint | Method::Corrected => "adiabatic efficiency, %",
        Method::Imported => "isentropic efficiency, %",
    };
    let mut panel =
        Panel::new(flow_axis(units), Axis::new(name)).title("(b) efficiency with its 95 % interval");
    if let Some(fitted) = &map.fitted {
        fitted_items::add_eta(&mut panel, map, fitted);
    }
    let last = map.lines.len().saturating_sub(1).max(1) as f64;
    for (index, line) in map.lines.iter().enumerate() {
        let colour = palette::sequential(index as f64 / last);
        let points: Vec<(ScatterPoint, Verdict)> = points_surge_to_choke(map, line)
            .into_iter()
            .filter_map(|point| {
                let p = &point.identified;
                let interval = p.eta_low.zip(p.eta_high).map(|(low, high)| (100.0 * low, 100.0 * high));
                let eta = 100.0 * point.eta?;
                let x = point.flow_corrected_kg_s;
                Some((ScatterPoint { x, y: eta, x_interval: None, y_interval: interval }, p.verdict))
            })
            .collect();
        if points.is_empty() {
            continue;
        }
        let label = format!("{} {}", speed(line.speed_corrected_rpm, units), units.speed);
        if map.fitted.is_none() {
            panel.add(Line::new(points.iter().map(|(p, _)| (p.x, p.y)).collect(), colour).label(&label));
        }
        for (verdict, marker) in [(Verdict::Good, Marker::Circle), (Verdict::Doubtful, Marker::Diamond)] {
            let members: Vec<ScatterPoint> = points.iter().filter(|p| p.1 == verdict).map(|p| p.0).collect();
            let scatter = Scatter::new(members, colour).marker(marker);
            // One entry per line; the other panel's legend also explains the diamond for doubtful points.
            panel.add(if verdict == Verdict::Good { scatter.label(&label) } else { scatter.size_px(8.0) });
        }
    }
    if map
        .lines
        .iter()
        .flat_map(|l| &l.points)
        .any(|p| p.identified.verdict == Verdict::Doubtful && p.eta.is_some())
    {
        let example: Vec<(f64, f64)> = Vec::new();
        panel
            .add(Scatter::new(example, palette::GREY).marker(Marker::Diamond).size_px(8.0).label("doubtful"));
    }
    panel
}

/// Points with the same marker: a verdict and a range of the half width of the 95 % interval, fraction.
struct Class {
    verdict: Verdict,
    above: f64,
    up_to: f64,
    size_px: f64,
    label: &'static str,
}

const fn class(verdict: Verdict, above: f64, up_to: f64, size_px: f64, label: &'static str) -> Class {
    Class { verdict, above, up_to, size_px, label }
}

const NO_INTERVAL: f64 = -1.0;

/// A larger marker means a larger uncertainty. A missing interval has its own class.
const CLASSES: [Class; 9] = [
    class(Verdict::Good, f64::NEG_INFINITY, NO_INTERVAL, 4.0, "good, error unknown"),
    class(Verdict::Good, NO_INTERVAL, 0.005, 6.5, "good, 95 % within ±0.5 points"),
    class(Verdict::Good, 0.005, 0.02, 9.0, "good, 95 % within ±2 points"),
    class(Verdict::Good, 0.02, f64::INFINITY, 12.5, "good, 95 % beyond ±2 points"),
    class(Verdict::Doubtful, f64::NEG_INFINITY, NO_INTERVAL, 4.0, "doubtful, error unknown"),
    class(Verdict::Doubtful, NO_INTERVAL, 0.005, 6.5, "doubtful, 95 % within ±0.5 points"),
    class(Verdict::Doubtful, 0.005, 0.02, 9.0, "doubtful, 95 % within ±2 points"),
    class(Verdict::Doubtful, 0.02, f64::INFINITY, 12.5, "doubtful, 95 % beyond ±2 points"),
    class(Verdict::Unusable, f64::NEG_INFINITY, f64::INFINITY, 7.0, "no usable efficiency"),
];

impl Class {
    fn holds(&self, point: &MapPoint) -> bool {
        let p = &point.identified;
        let verdict = if point.eta.is_none() { Verdict::Unusable } else { p.verdict };
        let half_width = p.eta_low.zip(p.eta_high).map(|(low, high)| 0.5 * (high - low));
        let half_width = half_width.filter(|w| *w >= 0.0).unwrap_or(NO_INTERVAL);
        verdict == self.verdict && half_width <= self.up_to && half_width > self.above
    }

    fn scatter(&self, points: Vec<(f64, f64)>) -> Scatter {
        match self.verdict {
            Verdict::Good => Scatter::new(points, palette::BLUE).size_px(self.size_px),
            Verdict::Doubtful => {
                Scatter::new(points, palette::VERMILLION).marker(Marker::Diamond).size_px(self.size_px)
            }
            Verdict::Unusable => Scatter::new(points, palette::INK).hollow().size_px(self.size_px),
        }
    }
}
