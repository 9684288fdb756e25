//! A drawing of a map, and of anything else, as data.

use crate::efficiency_mesh::{
    contour_levels, efficiency_surface, fitted_surface, points_surge_to_choke, speed_curve,
};
use crate::items::{Dash, Note};
use crate::{Colour, ScatterPoint, StructuredGrid, contour_lines};
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
    /// Soft surge: corrected flow, pressure ratio.
    pub soft: Vec<(f64, f64)>,
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
        let soft = map.surge.iter().filter_map(|mark| mark.soft);
        let soft = soft.map(|soft| (soft.flow_corrected_kg_s, soft.pressure_ratio)).collect();
        let Some(fitted) = &map.fitted else {
            let lines = map.lines.iter().map(|line| measured_line(map, line)).collect();
            return MapDrawing {
                lines,
                surface: efficiency_surface(map),
                sought,
                soft,
                ..MapDrawing::default()
            };
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
            soft,
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

/// The curve of a line between its measured flows and above its lowest efficiency: at choke the flow shows no end of the range.
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

fn at_flow(a: EtaDrawing, b: EtaDrawing, flow_kg_s: f64) -> EtaDrawing {
    let share = (a.flow_corrected_kg_s - flow_kg_s) / (a.flow_corrected_kg_s - b.flow_corrected_kg_s);
    let between = |a: f64, b: f64| a + share * (b - a);
    EtaDrawing {
        flow_corrected_kg_s: flow_kg_s,
        eta: between(a.eta, b.eta),
        eta_standard_error: between(a.eta_standard_error, b.eta_standard_error),
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Stroke {
    pub colour: Colour,
    pub width_px: f64,
    pub dash: Dash,
}

impl Stroke {
    pub(crate) fn solid(colour: Colour, width_px: f64) -> Self {
        Stroke { colour, width_px, dash: Dash::Solid }
    }

    pub(crate) fn drawn_width_px(&self) -> f64 {
        if self.width_px.is_finite() { self.width_px.clamp(0.1, 20.0) } else { 1.0 }
    }

    /// Lengths of dashes and gaps, px; empty for a solid line.
    pub(crate) fn dashes_px(&self) -> Vec<f64> {
        let pattern: &[f64] = match self.dash {
            Dash::Solid => &[],
            Dash::Dashed => &[4.0, 2.5],
            Dash::Dotted => &[1.0, 2.0],
            Dash::DashDot => &[5.0, 2.0, 1.0, 2.0],
        };
        pattern.iter().map(|part| part * self.drawn_width_px().max(1.2)).collect()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextAnchor {
    Start,
    Middle,
    End,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct TextStyle {
    pub size_px: f64,
    pub colour: Colour,
    pub anchor: TextAnchor,
    pub bold: bool,
    /// White rim, so that the text stays legible on lines.
    pub halo: bool,
    /// Counter-clockwise rotation, degrees.
    pub turn_deg: f64,
}

impl TextStyle {
    pub(crate) fn new(size_px: f64, colour: Colour, anchor: TextAnchor) -> Self {
        TextStyle { size_px, colour, anchor, bold: false, halo: false, turn_deg: 0.0 }
    }

    pub(crate) fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    pub(crate) fn halo(mut self) -> Self {
        self.halo = true;
        self
    }

    pub(crate) fn turned(mut self, turn_deg: f64) -> Self {
        self.turn_deg = turn_deg;
        self
    }
}

/// A point of the picture, px from its upper left corner.
pub(crate) type Px = (f64, f64);

#[derive(Debug, Clone)]
pub(crate) enum Shape {
    OpenGroup(String),
    OpenNote(Note),
    CloseNote(Note),
    CloseGroup,
    Line(Px, Px, Stroke),
    /// At least two points.
    Polyline(Vec<Px>, Stroke),
    /// Polygons of at least three points as one shape, so that there is no gap between neighbours; opacity 0 to 1.
    Areas(Vec<Vec<Px>>, Colour, f64),
    Polygon(Vec<Px>, Colour, Stroke),
    /// Centre and radius.
    Circle(Px, f64, Colour, Stroke),
    /// A text, not empty, with its vertical middle at the point.
    Text(Px, String, TextStyle),
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Drawing {
    pub width_px: f64,
    pub height_px: f64,
    pub title: String,
    pub shapes: Vec<Shape>,
}

impl Drawing {
    pub(crate) fn noted(&mut self, note: &Note, draw: impl FnOnce(&mut Drawing)) {
        self.shapes.push(Shape::OpenNote(note.clone()));
        draw(self);
        self.shapes.push(Shape::CloseNote(note.clone()));
    }

    pub(crate) fn line(&mut self, from: Px, to: Px, stroke: &Stroke) {
        self.shapes.push(Shape::Line(from, to, *stroke));
    }

    pub(crate) fn polyline(&mut self, points: &[Px], stroke: &Stroke) {
        if points.len() > 1 {
            self.shapes.push(Shape::Polyline(points.to_vec(), *stroke));
        }
    }

    pub(crate) fn areas(&mut self, polygons: &[Vec<Px>], fill: Colour, opacity: f64) {
        let polygons: Vec<_> = polygons.iter().filter(|polygon| polygon.len() > 2).cloned().collect();
        if !polygons.is_empty() {
            let opacity = if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 };
            self.shapes.push(Shape::Areas(polygons, fill, opacity));
        }
    }

    pub(crate) fn polygon(&mut self, points: &[Px], fill: Colour, stroke: &Stroke) {
        self.shapes.push(Shape::Polygon(points.to_vec(), fill, *stroke));
    }

    pub(crate) fn circle(&mut self, centre: Px, radius: f64, fill: Colour, stroke: &Stroke) {
        self.shapes.push(Shape::Circle(centre, radius, fill, *stroke));
    }

    pub(crate) fn text(&mut self, at: Px, text: &str, style: &TextStyle) {
        if !text.is_empty() {
            self.shapes.push(Shape::Text(at, text.to_owned(), *style));
        }
    }
}
