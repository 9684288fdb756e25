//! Lines, contours and ends of the map in the form that the script draws.

use crate::Display;
use mapper_campaign::units::Kind;
use mapper_chart::efficiency_mesh::{contour_levels, efficiency_surface, fitted_surface, speed_curve};
use mapper_chart::{StructuredGrid, contour_lines};
use mapper_core::{CompressorMap, FittedNode, half_width_95};
use serde::Serialize;

/// The map without its points.
#[derive(Debug, Clone, Serialize, Default)]
pub(crate) struct DrawnMap {
    lines: Vec<DrawnLine>,
    contours: Vec<DrawnContour>,
    surge: Vec<[f64; 2]>,
    choke: Vec<[f64; 2]>,
    sought: Vec<DrawnMark>,
}

/// A speed line from the choke side to the surge side.
#[derive(Debug, Clone, Serialize)]
struct DrawnLine {
    speed: String,
    measured: bool,
    nodes: Vec<DrawnNode>,
}

/// A place on a line: flow, pressure ratio, efficiency in % and the half width of its 95 % interval.
#[derive(Debug, Clone, Serialize)]
struct DrawnNode {
    flow: f64,
    pr: f64,
    eta: Option<f64>,
    half: Option<f64>,
    out: bool,
}

/// Lines of one efficiency, %.
#[derive(Debug, Clone, Serialize)]
struct DrawnContour {
    eta: f64,
    paths: Vec<Vec<[f64; 2]>>,
}

/// A measured surge-side end, with half widths of its 95 % intervals.
#[derive(Debug, Clone, Serialize)]
struct DrawnMark {
    flow: f64,
    flow_half: f64,
    pr: f64,
    pr_half: f64,
}

/// Everything except the points.
pub(crate) fn drawn_map(map: &CompressorMap, display: &Display) -> DrawnMap {
    let flow = |kg_s: f64| rounded(display.number(Kind::MassFlow, kg_s));
    let place = |node: &FittedNode| [flow(node.flow_corrected_kg_s), rounded(node.pressure_ratio)];
    let node = |node: &FittedNode| DrawnNode {
        flow: flow(node.flow_corrected_kg_s),
        pr: rounded(node.pressure_ratio),
        eta: Some(rounded(100.0 * node.eta)),
        half: Some(rounded(100.0 * half_width_95(node.eta_standard_error))),
        out: node.extrapolated,
    };
    let sought = map.surge.iter().map(|mark| DrawnMark {
        flow: flow(mark.flow_corrected_kg_s),
        flow_half: half_width_95(display.number(Kind::MassFlow, mark.flow_total_standard_error_kg_s())),
        pr: rounded(mark.pressure_ratio),
        pr_half: half_width_95(mark.pressure_ratio_standard_error),
    });
    match &map.fitted {
        Some(fitted) => DrawnMap {
            lines: fitted
                .lines
                .iter()
                .map(|line| DrawnLine {
                    speed: display.line_name(line.speed_corrected_rpm),
                    measured: line.measured,
                    nodes: line.nodes.iter().map(node).collect(),
                })
                .collect(),
            contours: contours(fitted_surface(fitted), flow),
            surge: fitted.surge_line().map(|(_, node)| place(node)).collect(),
            choke: fitted.choke_line().map(|(_, node)| place(node)).collect(),
            sought: sought.collect(),
        },
        None => DrawnMap {
            lines: map
                .lines
                .iter()
                .map(|line| DrawnLine {
                    speed: display.line_name(line.speed_corrected_rpm),
                    measured: true,
                    nodes: speed_curve(map, line)
                        .into_iter()
                        .map(|(kg_s, pr)| DrawnNode {
                            flow: flow(kg_s),
                            pr: rounded(pr),
                            eta: None,
                            half: None,
                            out: false,
                        })
                        .collect(),
                })
                .collect(),
            contours: contours(efficiency_surface(map), flow),
            sought: sought.collect(),
            ..DrawnMap::default()
        },
    }
}

fn contours(grid: Option<StructuredGrid>, flow: impl Fn(f64) -> f64) -> Vec<DrawnContour> {
    let Some(grid) = grid else { return Vec::new() };
    let levels = contour_levels(grid.value_range()).into_iter();
    levels
        .map(|level| DrawnContour {
            eta: rounded(100.0 * level),
            paths: contour_lines(&grid, level)
                .into_iter()
                .map(|path| path.into_iter().map(|(kg_s, pr)| [flow(kg_s), rounded(pr)]).collect())
                .collect(),
        })
        .filter(|contour: &DrawnContour| !contour.paths.is_empty())
        .collect()
}

/// Rounds to four decimals: more are not visible on a screen, and took a third of the bytes.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
