//! The picture of a map: lines, points, contours of efficiency, and the fitted surface.

use crate::heading::{efficiency_name, percent, speed};
use mapper_chart::efficiency_mesh::{
    SUBDIVISIONS, contour_levels, efficiency_surface, fitted_surface, interpolate_between_lines,
    points_surge_to_choke, speed_curve,
};
use mapper_chart::{
    Axis, Contours, Dash, Figure, Line, LineEnd, Marker, Panel, Polygon, Scatter, ScatterPoint, palette,
};
use mapper_core::{
    CompressorMap, FittedLine, FittedMap, FittedNode, MapPoint, MapUnits, Method, SpeedLine, SurgeMark,
    Verdict, confidence_interval_95,
};

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
        Some(fitted) => add_map(&mut panel, fitted, units),
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
        add_eta(&mut panel, map, fitted);
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

const SURGE: palette::Colour = palette::VERMILLION;
const CHOKE: palette::Colour = palette::PURPLE;
/// All items below the points in the panel of pressure ratio over flow.
pub(crate) fn add_map(panel: &mut Panel, fitted: &FittedMap, units: &MapUnits) {
    add_shade(panel, fitted);
    if let Some(grid) = fitted_surface(fitted) {
        let levels = contour_levels(grid.value_range());
        panel.add(Contours::new(grid, &levels, percent));
    }
    for line in &fitted.lines {
        let all = || line.nodes.iter().map(|n| (place(n), n.extrapolated));
        let colour = if line.measured { palette::INK } else { palette::GREY };
        panel.add(Line::new(runs(all(), true), palette::GREY).width_px(1.0).dash(Dash::Dashed));
        panel.add(Line::new(runs(all(), false), colour).width_px(1.3));
    }
    // If two speed labels overlap, the first one is kept, so measured lines come first.
    let (measured, others): (Vec<&FittedLine>, Vec<&FittedLine>) =
        fitted.lines.iter().partition(|line| line.measured);
    for line in measured.into_iter().chain(others) {
        let colour = if line.measured { palette::INK } else { palette::GREY };
        // An invisible line at the last visible node carries the speed label.
        let end = line.nodes.iter().find(|n| !n.extrapolated).or_else(|| middle(line)).map(place);
        panel.add(
            Line::new(end.into_iter().collect(), colour)
                .width_px(0.0)
                .end_label(speed(line.speed_corrected_rpm, units), LineEnd::Last),
        );
    }
    let surge: Vec<(f64, f64)> = fitted.surge_line().map(|(_, n)| place(n)).collect();
    let choke: Vec<(f64, f64)> = fitted.choke_line().map(|(_, n)| place(n)).collect();
    panel.add(Line::new(surge, SURGE).width_px(1.6).dash(Dash::DashDot).label("surge-side end of the lines"));
    panel.add(Line::new(choke, CHOKE).width_px(1.6).dash(Dash::Dotted).label("choke"));
    panel.add(Line::new(Vec::new(), palette::GREY).width_px(1.0).dash(Dash::Dashed).label("extrapolated"));
}

/// Fitted efficiency of the measured lines over flow, with its 95 % band, within each line's measured range. Beyond, towards
/// pressure ratio 1, it falls to 0 and would compress the measured range into the top of the picture.
pub(crate) fn add_eta(panel: &mut Panel, map: &CompressorMap, fitted: &FittedMap) {
    let measured: Vec<&FittedLine> = fitted.lines.iter().filter(|line| line.measured).collect();
    let last = measured.len().saturating_sub(1).max(1) as f64;
    for (index, (line, own)) in measured.iter().zip(&map.lines).enumerate() {
        let colour = palette::sequential(index as f64 / last);
        let drawn = between_points(line, own);
        let side = |low: bool| {
            drawn.iter().map(move |(flow_kg_s, eta, standard_error)| {
                let (below, above) = confidence_interval_95(*eta, *standard_error);
                (*flow_kg_s, 100.0 * if low { below } else { above })
            })
        };
        let mut band: Vec<(f64, f64)> = side(true).collect();
        band.extend(side(false).collect::<Vec<_>>().into_iter().rev());
        panel.add(Polygon { opacity: 0.25, ..Polygon::new(band, colour) });
        let curve = drawn.iter().map(|(flow_kg_s, eta, _)| (*flow_kg_s, 100.0 * eta)).collect();
        panel.add(Line::new(curve, colour).width_px(1.2));
    }
}

/// A point on a line's curve: flow, efficiency and its standard error.
type CurvePoint = (f64, f64, f64);

/// The curve of a line between its largest and its smallest measured flow, interpolated at its ends, and above its lowest
/// efficiency: at choke the flow no longer shows the end of the measured range.
fn between_points(line: &FittedLine, own: &SpeedLine) -> Vec<CurvePoint> {
    let points = || own.points.iter().filter(|point| point.eta.is_some());
    let flows = || points().map(|point| point.flow_corrected_kg_s);
    let (smallest_kg_s, largest_kg_s) =
        (flows().fold(f64::INFINITY, f64::min), flows().fold(f64::NEG_INFINITY, f64::max));
    let lowest =
        points().filter_map(|point| point.identified.eta_low.or(point.eta)).fold(f64::INFINITY, f64::min);
    let mut drawn: Vec<CurvePoint> = Vec::new();
    let mut before: Option<CurvePoint> = None;
    // From choke to surge.
    for node in line.nodes.iter().map(|n| (n.flow_corrected_kg_s, n.eta, n.eta_standard_error)) {
        let (flow_kg_s, eta, _) = node;
        if flow_kg_s < smallest_kg_s {
            drawn.extend(
                before.filter(|_| !drawn.is_empty()).map(|before| at_flow(before, node, smallest_kg_s)),
            );
            break;
        }
        if flow_kg_s <= CHOKED_RATIO * largest_kg_s && (eta >= lowest || !drawn.is_empty()) {
            let beyond = before.filter(|before| drawn.is_empty() && before.0 > CHOKED_RATIO * largest_kg_s);
            drawn.extend(beyond.map(|before| at_flow(before, node, largest_kg_s)));
            drawn.push(node);
        }
        before = Some(node);
    }
    drawn
}

/// A line is choked if its flow changes by less than this factor from one measured point to the next.
const CHOKED_RATIO: f64 = 1.01;

/// The curve between two nodes, interpolated in flow.
fn at_flow(a: CurvePoint, b: CurvePoint, flow_kg_s: f64) -> CurvePoint {
    let share = (a.0 - flow_kg_s) / (a.0 - b.0);
    let at = |a: f64, b: f64| a + share * (b - a);
    (flow_kg_s, at(a.1, b.1), at(a.2, b.2))
}

fn place(node: &FittedNode) -> (f64, f64) {
    (node.flow_corrected_kg_s, node.pressure_ratio)
}

fn middle(line: &FittedLine) -> Option<&FittedNode> {
    line.nodes.get(line.nodes.len() / 2)
}

/// Points of one kind; NaN breaks the line at a change of kind. A dashed line extends to its solid neighbours.
fn runs(points: impl Iterator<Item = ((f64, f64), bool)>, extrapolated: bool) -> Vec<(f64, f64)> {
    let all: Vec<((f64, f64), bool)> = points.collect();
    let belongs = |i: usize| {
        all[i].1 == extrapolated
            || extrapolated && (i > 0 && all[i - 1].1 || i + 1 < all.len() && all[i + 1].1)
    };
    (0..all.len()).map(|i| if belongs(i) { all[i].0 } else { (f64::NAN, f64::NAN) }).collect()
}

/// Grey between neighbouring lines if a corner is extrapolated, one polygon for each run of nodes. From line to line
/// it has the same boundary curves as the contours, so that no white gap remains.
fn add_shade(panel: &mut Panel, fitted: &FittedMap) {
    let speeds: Vec<f64> = fitted.lines.iter().map(|line| line.speed_corrected_rpm).collect();
    if speeds.len() < 2 || !speeds.windows(2).all(|w| w[1] > w[0]) {
        return;
    }
    let side = |column: usize, pair: usize| -> Vec<(f64, f64)> {
        let over_speed = |value: fn(&FittedNode) -> f64| {
            let values: Vec<f64> =
                fitted.lines.iter().map(|line| line.nodes.get(column).map_or(f64::NAN, value)).collect();
            interpolate_between_lines(&speeds, &values)
        };
        let (flow, ratio) = (over_speed(|n| n.flow_corrected_kg_s), over_speed(|n| n.pressure_ratio));
        (pair * SUBDIVISIONS..=(pair + 1) * SUBDIVISIONS).map(|i| (flow[i], ratio[i])).collect()
    };
    for (index, pair) in fitted.lines.windows(2).enumerate() {
        let (low, high) = (&pair[0].nodes, &pair[1].nodes);
        let grey = |i: usize| [&low[i], &low[i + 1], &high[i], &high[i + 1]].iter().any(|n| n.extrapolated);
        let cells = low.len().min(high.len()).saturating_sub(1);
        let mut start = 0;
        while start < cells {
            if !grey(start) {
                start += 1;
                continue;
            }
            let end = (start..cells).take_while(|i| grey(*i)).last().unwrap_or(start) + 1;
            let mut outline: Vec<(f64, f64)> = low[start..=end].iter().map(place).collect();
            outline.extend(side(end, index));
            outline.extend(high[start..=end].iter().rev().map(place));
            outline.extend(side(start, index).into_iter().rev());
            panel
                .add(Polygon { opacity: 0.16, ..Polygon::new(outline, palette::GREY).label("extrapolated") });
            start = end;
        }
    }
}
