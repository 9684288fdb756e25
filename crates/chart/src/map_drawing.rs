//! A compressor map as data to draw: the one description behind the picture of a map and its drawing on a page.

use crate::efficiency_mesh::{
    contour_levels, efficiency_surface, fitted_surface, points_surge_to_choke, speed_curve,
};
use crate::{ScatterPoint, StructuredGrid, contour_lines};
use mapper_core::{CompressorMap, FittedLine, FittedNode, SpeedLine, SurgeMark, confidence_interval_95};

/// Everything of a map but its points, in SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MapDrawing {
    /// Speed lines in order of speed.
    pub lines: Vec<LineDrawing>,
    /// Efficiency (fraction) over corrected flow and pressure ratio; `None` without two lines.
    pub surface: Option<StructuredGrid>,
    /// Surge-side ends of the fitted lines: corrected flow, pressure ratio.
    pub surge: Vec<(f64, f64)>,
    /// Choke of the fitted lines.
    pub choke: Vec<(f64, f64)>,
    /// Measured surge-side ends with their 95 % intervals.
    pub sought: Vec<ScatterPoint>,
}

/// A speed line.
#[derive(Debug, Clone, PartialEq)]
pub struct LineDrawing {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Whether points were measured on it.
    pub measured: bool,
    /// Its course on the map.
    pub nodes: Vec<NodeDrawing>,
    /// Its efficiency within the measured range.
    pub eta: Vec<EtaDrawing>,
}

/// A place on a speed line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeDrawing {
    /// Corrected flow, kg/s, and pressure ratio.
    pub place: (f64, f64),
    /// Whether the fit is not supported by points there.
    pub extrapolated: bool,
}

/// Efficiency at a flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EtaDrawing {
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Fraction.
    pub eta: f64,
    /// 0 without a fit.
    pub eta_standard_error: f64,
}

/// An efficiency (fraction) and its contour lines.
pub type ContourDrawing = (f64, Vec<Vec<(f64, f64)>>);

impl MapDrawing {
    /// The fitted lines, or curves through the points.
    pub fn new(map: &CompressorMap) -> Self {
        let sought = map.surge.iter().map(surge_mark).collect();
        let Some(fitted) = &map.fitted else {
            let lines = map.lines.iter().map(|line| measured_line(map, line)).collect();
            return MapDrawing { lines, surface: efficiency_surface(map), sought, ..MapDrawing::default() };
        };
        let mut own_points = map.lines.iter();
        let lines = fitted.lines.iter().map(|line| LineDrawing {
            speed_corrected_rpm: line.speed_corrected_rpm,
            measured: line.measured,
            nodes: line
                .nodes
                .iter()
                .map(|node| NodeDrawing { place: place(node), extrapolated: node.extrapolated })
                .collect(),
            eta: match line.measured.then(|| own_points.next()).flatten() {
                Some(own) => between_points(line, own),
                None => Vec::new(),
            },
        });
        MapDrawing {
            lines: lines.collect(),
            surface: fitted_surface(fitted),
            surge: fitted.surge_line().map(|(_, node)| place(node)).collect(),
            choke: fitted.choke_line().map(|(_, node)| place(node)).collect(),
            sought,
        }
    }

    /// The levels of the contours, fractions.
    pub fn levels(&self) -> Vec<f64> {
        self.surface.as_ref().map(|grid| contour_levels(grid.value_range())).unwrap_or_default()
    }

    /// The contours of efficiency.
    pub fn contours(&self) -> Vec<ContourDrawing> {
        let Some(grid) = &self.surface else { return Vec::new() };
        let contours = self.levels().into_iter().map(|level| (level, contour_lines(grid, level)));
        contours.filter(|(_, paths)| !paths.is_empty()).collect()
    }
}

fn measured_line(map: &CompressorMap, line: &SpeedLine) -> LineDrawing {
    let nodes = speed_curve(map, line).into_iter().map(|place| NodeDrawing { place, extrapolated: false });
    let eta = points_surge_to_choke(map, line).into_iter().filter_map(|point| {
        Some(EtaDrawing {
            flow_corrected_kg_s: point.flow_corrected_kg_s,
            eta: point.eta?,
            eta_standard_error: 0.0,
        })
    });
    LineDrawing {
        speed_corrected_rpm: line.speed_corrected_rpm,
        measured: true,
        nodes: nodes.collect(),
        eta: eta.collect(),
    }
}

fn surge_mark(mark: &SurgeMark) -> ScatterPoint {
    let (flow, ratio) = (mark.flow_corrected_kg_s, mark.pressure_ratio);
    ScatterPoint {
        x: flow,
        y: ratio,
        x_interval: Some(confidence_interval_95(flow, mark.flow_total_standard_error_kg_s())),
        y_interval: Some(confidence_interval_95(ratio, mark.pressure_ratio_standard_error)),
    }
}

fn place(node: &FittedNode) -> (f64, f64) {
    (node.flow_corrected_kg_s, node.pressure_ratio)
}

/// The curve of a line between its largest and its smallest measured flow, interpolated at its ends, and above its lowest
/// efficiency: at choke the flow no longer shows the end of the measured range.
fn between_points(line: &FittedLine, own: &SpeedLine) -> Vec<EtaDrawing> {
    let points = || own.points.iter().filter(|point| point.eta.is_some());
    let flows = || points().map(|point| point.flow_corrected_kg_s);
    let (smallest_kg_s, largest_kg_s) =
        (flows().fold(f64::INFINITY, f64::min), flows().fold(f64::NEG_INFINITY, f64::max));
    let lowest =
        points().filter_map(|point| point.identified.eta_low.or(point.eta)).fold(f64::INFINITY, f64::min);
    let mut drawn: Vec<EtaDrawing> = Vec::new();
    let mut before: Option<EtaDrawing> = None;
    // From choke to surge.
    for node in &line.nodes {
        let node = EtaDrawing {
            flow_corrected_kg_s: node.flow_corrected_kg_s,
            eta: node.eta,
            eta_standard_error: node.eta_standard_error,
        };
        let (flow_kg_s, eta) = (node.flow_corrected_kg_s, node.eta);
        if flow_kg_s < smallest_kg_s {
            drawn.extend(
                before.filter(|_| !drawn.is_empty()).map(|before| at_flow(before, node, smallest_kg_s)),
            );
            break;
        }
        if flow_kg_s <= CHOKED_RATIO * largest_kg_s && (eta >= lowest || !drawn.is_empty()) {
            let beyond = before.filter(|before| {
                drawn.is_empty() && before.flow_corrected_kg_s > CHOKED_RATIO * largest_kg_s
            });
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
fn at_flow(a: EtaDrawing, b: EtaDrawing, flow_kg_s: f64) -> EtaDrawing {
    let share = (a.flow_corrected_kg_s - flow_kg_s) / (a.flow_corrected_kg_s - b.flow_corrected_kg_s);
    let between = |a: f64, b: f64| a + share * (b - a);
    EtaDrawing {
        flow_corrected_kg_s: flow_kg_s,
        eta: between(a.eta, b.eta),
        eta_standard_error: between(a.eta_standard_error, b.eta_standard_error),
    }
}
