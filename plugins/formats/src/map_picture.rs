//! The picture of a map: lines, points, contours of efficiency, and the fitted surface.

use crate::simulation_table::{efficiency_name, percent, speed};
use mapper_chart::efficiency_mesh::{SUBDIVISIONS, interpolate_between_lines, points_surge_to_choke};
use mapper_chart::{
    Axis, Contours, Dash, Figure, Line, LineDrawing, LineEnd, MapDrawing, Marker, NodeDrawing, Panel,
    Polygon, Scatter, ScatterPoint, palette,
};
use mapper_core::{
    CompressorMap, FittedMap, FittedNode, MapPoint, MapUnits, Method, Verdict, confidence_interval_95,
};

/// The map as a figure of two panels in these units, efficiency in %.
pub fn map_figure(map: &CompressorMap, units: &MapUnits) -> Figure {
    let points = map.lines.iter().map(|line| line.points.len()).sum::<usize>();
    let drawing = MapDrawing::new(map);
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
        .panel(map_panel(map, &drawing, units))
        .panel(efficiency_panel(map, &drawing, units))
        .panel_size_px(560.0, 460.0)
}

/// Corrected flow in display units; items of a panel are in kg/s.
fn flow_axis(units: &MapUnits) -> Axis {
    Axis::new(format!("corrected mass flow, {}", units.flow)).written_times(units.flow_of_one_kg_s)
}

/// Panel (a): items in kg/s and pressure ratio.
fn map_panel(map: &CompressorMap, drawing: &MapDrawing, units: &MapUnits) -> Panel {
    let mut panel = Panel::new(flow_axis(units), Axis::new("total pressure ratio P2/P1"))
        .title(format!("(a) speed lines ({}, corrected) and efficiency contours (%)", units.speed));
    add_map(&mut panel, drawing, map.fitted.as_ref(), units);
    if !drawing.sought.is_empty() {
        let marks = Scatter::new(drawing.sought.clone(), palette::VERMILLION);
        panel.add(marks.marker(Marker::Square).label("surge, sought"));
    }
    if let Some(soft) = map.surge.iter().find_map(|mark| mark.soft) {
        let label = format!("soft surge, {} variation {:.2} %", soft.channel, 100.0 * soft.variation_ratio);
        panel.add(Line::new(drawing.soft.clone(), SURGE).width_px(1.2).dash(Dash::Dashed).label(label));
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

fn efficiency_panel(map: &CompressorMap, drawing: &MapDrawing, units: &MapUnits) -> Panel {
    let name = match map.method {
        Method::Steady => "apparent efficiency, %",
        Method::Dynamic | Method::Joint | Method::Corrected => "adiabatic efficiency, %",
        Method::Imported => "isentropic efficiency, %",
    };
    let mut panel =
        Panel::new(flow_axis(units), Axis::new(name)).title("(b) efficiency with its 95 % interval");
    add_eta(&mut panel, drawing);
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
fn add_map(panel: &mut Panel, drawing: &MapDrawing, fitted: Option<&FittedMap>, units: &MapUnits) {
    if let Some(fitted) = fitted {
        add_shade(panel, fitted);
    }
    if let Some(grid) = &drawing.surface {
        panel.add(Contours::new(grid.clone(), &drawing.levels(), percent));
    }
    for line in &drawing.lines {
        let colour = if line.measured { palette::INK } else { palette::GREY };
        panel.add(Line::new(runs(&line.nodes, true), palette::GREY).width_px(1.0).dash(Dash::Dashed));
        panel.add(Line::new(runs(&line.nodes, false), colour).width_px(1.3));
    }
    // If two speed labels overlap, the first one is kept, so measured lines come first.
    let (measured, others): (Vec<&LineDrawing>, Vec<&LineDrawing>) =
        drawing.lines.iter().partition(|line| line.measured);
    for line in measured.into_iter().chain(others) {
        let colour = if line.measured { palette::INK } else { palette::GREY };
        // An invisible line at its choke-side end carries the speed label.
        let end = choke_end(line, fitted.is_some());
        panel.add(
            Line::new(end.into_iter().collect(), colour)
                .width_px(0.0)
                .end_label(speed(line.speed_corrected_rpm, units), LineEnd::Last),
        );
    }
    if fitted.is_none() {
        return;
    }
    let (surge, choke) = (drawing.surge.clone(), drawing.choke.clone());
    panel.add(Line::new(surge, SURGE).width_px(1.6).dash(Dash::DashDot).label("surge-side end of the lines"));
    panel.add(Line::new(choke, CHOKE).width_px(1.6).dash(Dash::Dotted).label("choke"));
    panel.add(Line::new(Vec::new(), palette::GREY).width_px(1.0).dash(Dash::Dashed).label("extrapolated"));
}

/// The visible end of a line: fitted lines begin at choke, curves through points end there.
fn choke_end(line: &LineDrawing, is_fitted: bool) -> Option<(f64, f64)> {
    let visible = |node: &&NodeDrawing| !node.extrapolated;
    let end = if is_fitted { line.nodes.iter().find(visible) } else { line.nodes.iter().rfind(visible) };
    end.or_else(|| line.nodes.get(line.nodes.len() / 2)).map(|node| node.place)
}

/// Efficiency of the measured lines over flow, with its 95 % band, within each line's measured range. Beyond, towards
/// pressure ratio 1, it falls to 0 and would compress the measured range into the top of the picture.
fn add_eta(panel: &mut Panel, drawing: &MapDrawing) {
    let measured: Vec<&LineDrawing> = drawing.lines.iter().filter(|line| line.measured).collect();
    let last = measured.len().saturating_sub(1).max(1) as f64;
    for (index, line) in measured.iter().enumerate() {
        let colour = palette::sequential(index as f64 / last);
        let side = |low: bool| {
            line.eta.iter().map(move |node| {
                let (below, above) = confidence_interval_95(node.eta, node.eta_standard_error);
                (node.flow_corrected_kg_s, 100.0 * if low { below } else { above })
            })
        };
        if line.eta.iter().any(|node| node.eta_standard_error > 0.0) {
            let mut band: Vec<(f64, f64)> = side(true).collect();
            band.extend(side(false).collect::<Vec<_>>().into_iter().rev());
            panel.add(Polygon { opacity: 0.25, ..Polygon::new(band, colour) });
        }
        let curve = line.eta.iter().map(|node| (node.flow_corrected_kg_s, 100.0 * node.eta)).collect();
        panel.add(Line::new(curve, colour).width_px(1.2));
    }
}

fn place(node: &FittedNode) -> (f64, f64) {
    (node.flow_corrected_kg_s, node.pressure_ratio)
}

/// Places of one kind; NaN breaks the line at a change of kind. A dashed line extends to its solid neighbours.
fn runs(nodes: &[NodeDrawing], extrapolated: bool) -> Vec<(f64, f64)> {
    let is_out =
        |index: Option<usize>| index.and_then(|i| nodes.get(i)).is_some_and(|node| node.extrapolated);
    let belongs = |i: usize| {
        nodes[i].extrapolated == extrapolated
            || extrapolated && (is_out(i.checked_sub(1)) || is_out(i.checked_add(1)))
    };
    (0..nodes.len()).map(|i| if belongs(i) { nodes[i].place } else { (f64::NAN, f64::NAN) }).collect()
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
