//! Differences between two maps, in units and in their uncertainty.

use crate::efficiency_definition::convert_efficiency;
use crate::map_fit::{MapFit, MapFitError, MapFitOptions};
use mapper_core::{CompressorMap, FittedLine, FittedNode, confidence_interval_95};
use mapper_numerics::polyline::NearestOnPolyline;
use serde::Serialize;

/// Nodes compared on each line.
const NODES: usize = 25;
/// How far apart the end lines of two maps may be and still count as one speed, ratio: a speed is held within a percent.
const END_SLACK: f64 = 0.01;

/// A place of the second map compared with the nearest place of the first at equal corrected speed. Differences: second minus
/// first.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComparedPlace {
    /// Corrected flow of the second map, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Pressure ratio of the second map.
    pub pressure_ratio: f64,
    /// Efficiency of the second map, fraction.
    pub eta: f64,
    /// Difference of flow across the line, kg/s.
    pub flow_difference_kg_s: f64,
    /// Difference of pressure ratio across the line.
    pub pressure_ratio_difference: f64,
    /// Distance across the line, in units of the first line's largest flow and largest PR - 1, positive outwards.
    pub distance_ratio: f64,
    /// Standard error of the distance, both maps together and with the gains and offsets that each map's points share, in
    /// the same units.
    pub distance_standard_error_ratio: f64,
    /// Difference of efficiency, fraction.
    pub eta_difference: f64,
    /// Standard error of the difference of efficiency, likewise, fraction.
    pub eta_standard_error: f64,
}

impl ComparedPlace {
    /// Whether the 95 % interval of the distance leaves 0 out.
    pub fn line_differs(&self) -> bool {
        beyond(self.distance_ratio, self.distance_standard_error_ratio)
    }

    /// Whether the 95 % interval of the difference of efficiency leaves 0 out.
    pub fn eta_differs(&self) -> bool {
        beyond(self.eta_difference, self.eta_standard_error)
    }
}

fn beyond(difference: f64, standard_error: f64) -> bool {
    let (low, high) = confidence_interval_95(difference, standard_error);
    low > 0.0 || high < 0.0
}

/// All places of a speed at which both maps are measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedLine {
    /// Corrected speed, rpm, at the first map's reference state.
    pub speed_corrected_rpm: f64,
    /// Places from the choke side to the surge side; empty if the lines do not overlap.
    pub places: Vec<ComparedPlace>,
}

/// Two maps side by side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapComparison {
    /// Lines in order of speed.
    pub lines: Vec<ComparedLine>,
    /// Speeds of either map that the other does not reach, rpm: not compared.
    pub not_compared_rpm: Vec<f64>,
    /// Root mean square of the distance over all places, ratio.
    pub distance_rms_ratio: f64,
    /// Root mean square of the difference of efficiency, fraction.
    pub eta_difference_rms: f64,
    /// Mean difference of efficiency, fraction.
    pub eta_difference_mean: f64,
    /// Share of places where the lines differ beyond their 95 % interval.
    pub line_differs_ratio: f64,
    /// Share of places where the efficiencies differ beyond their 95 % interval.
    pub eta_differs_ratio: f64,
}

/// Compares two maps, each by its own fit, at every measured speed that lies within both; the second is brought to the
/// first's reference state and definition of efficiency, if both files name theirs. Extrapolated places are left out.
///
/// # Errors
/// [`MapFitError`] if one of the maps cannot be fitted.
pub fn compare(first: &CompressorMap, second: &CompressorMap) -> Result<MapComparison, MapFitError> {
    let second = second.clone().at_reference(first.reference);
    // A difference of definitions is none of the machines.
    let second = match (second.efficiency, first.efficiency) {
        (Some(from), Some(to)) => convert_efficiency(second, from, to),
        _ => second,
    };
    let fits = [MapFit::new(first)?, MapFit::new(&second)?];
    let speeds = [speeds_of(first), speeds_of(&second)];
    let bounds =
        speeds.each_ref().map(|s| (s.first().copied().unwrap_or(0.0), s.last().copied().unwrap_or(0.0)));
    let (low, high) = (bounds[0].0.max(bounds[1].0), bounds[0].1.min(bounds[1].1));
    let within = |speed: &f64| *speed >= low && *speed <= high;
    // An end line that is a hair beyond the other map's is compared at that map's end.
    let to_common = |speed: &f64| {
        let nearest = speed.max(low).min(high);
        if (speed - nearest).abs() <= END_SLACK * nearest { nearest } else { *speed }
    };
    let mut all: Vec<f64> = speeds.iter().flatten().map(to_common).collect();
    all.sort_by(f64::total_cmp);
    // Two measured lines less than half a percent apart say the same.
    all.dedup_by(|b, a| *b <= *a * 1.005);
    let (common, not_compared_rpm): (Vec<f64>, Vec<f64>) = all.into_iter().partition(within);
    let options =
        MapFitOptions { further_speeds_rpm: Some(common.clone()), nodes: 4 * NODES, leave_one_out: false };
    let tables = [fits[0].table(&options)?, fits[1].table(&options)?];
    let line_at = |lines: &[FittedLine], speed: f64| {
        let near = |line: &&FittedLine| (line.speed_corrected_rpm - speed).abs();
        lines.iter().min_by(|a, b| near(a).total_cmp(&near(b))).cloned()
    };
    let lines: Vec<ComparedLine> = common
        .iter()
        .filter_map(|speed| {
            let places =
                compare_lines(&line_at(&tables[0].lines, *speed)?, &line_at(&tables[1].lines, *speed)?);
            Some(ComparedLine { speed_corrected_rpm: *speed, places })
        })
        .collect();
    Ok(summary(lines, not_compared_rpm))
}

fn speeds_of(map: &CompressorMap) -> Vec<f64> {
    let mut speeds: Vec<f64> =
        map.lines.iter().map(|line| line.speed_corrected_rpm).filter(|s| s.is_finite() && *s > 0.0).collect();
    speeds.sort_by(f64::total_cmp);
    speeds
}

fn summary(lines: Vec<ComparedLine>, not_compared_rpm: Vec<f64>) -> MapComparison {
    let places = || lines.iter().flat_map(|line| &line.places);
    let count = places().count().max(1) as f64;
    let mean = |value: fn(&ComparedPlace) -> f64| places().map(value).sum::<f64>() / count;
    let share = |differs: fn(&ComparedPlace) -> bool| places().filter(|p| differs(p)).count() as f64 / count;
    MapComparison {
        distance_rms_ratio: mean(|p| p.distance_ratio.powi(2)).sqrt(),
        eta_difference_rms: mean(|p| p.eta_difference.powi(2)).sqrt(),
        eta_difference_mean: mean(|p| p.eta_difference),
        line_differs_ratio: share(ComparedPlace::line_differs),
        eta_differs_ratio: share(ComparedPlace::eta_differs),
        lines,
        not_compared_rpm,
    }
}

fn compare_lines(first: &FittedLine, second: &FittedLine) -> Vec<ComparedPlace> {
    let known: Vec<&FittedNode> = first.nodes.iter().filter(|n| !n.extrapolated).collect();
    let flow_scale_kg_s = known.iter().map(|n| n.flow_corrected_kg_s).fold(1e-12, f64::max);
    let ratio_scale = known.iter().map(|n| n.pressure_ratio - 1.0).fold(1e-6, f64::max);
    let known = Known { nodes: &known, flow_scale_kg_s, ratio_scale };
    let nodes = second.nodes.iter().step_by(4).filter(|node| !node.extrapolated);
    nodes.filter_map(|node| known.compared(node)).collect()
}

/// A place of one line nearest to a node of the other.
struct Nearest<'a> {
    /// Second minus first.
    flow_difference_kg_s: f64,
    pressure_ratio_difference: f64,
    distance_ratio: f64,
    eta_difference: f64,
    /// Node of the first line just before the place.
    before: &'a FittedNode,
}

/// The first line, and the units in which distances from it are measured.
struct Known<'a> {
    nodes: &'a [&'a FittedNode],
    flow_scale_kg_s: f64,
    ratio_scale: f64,
}

impl Known<'_> {
    /// None if the nearest place is the line's very end: there the other line goes on alone.
    fn nearest(&self, node: &FittedNode) -> Option<Nearest<'_>> {
        let scaled = |n: &FittedNode| {
            (n.flow_corrected_kg_s / self.flow_scale_kg_s, n.pressure_ratio / self.ratio_scale)
        };
        let line: Vec<(f64, f64)> = self.nodes.iter().map(|node| scaled(node)).collect();
        let place = NearestOnPolyline::of(&line, scaled(node)).filter(|place| !place.beyond_end)?;
        let (before, after) = (self.nodes[place.segment], self.nodes[place.segment + 1]);
        let share = place.share_ratio;
        let between = |value: fn(&FittedNode) -> f64| value(before) + share * (value(after) - value(before));
        let flow_difference_kg_s = node.flow_corrected_kg_s - between(|n| n.flow_corrected_kg_s);
        let pressure_ratio_difference = node.pressure_ratio - between(|n| n.pressure_ratio);
        let (x, y) =
            (flow_difference_kg_s / self.flow_scale_kg_s, pressure_ratio_difference / self.ratio_scale);
        Some(Nearest {
            flow_difference_kg_s,
            pressure_ratio_difference,
            // Outwards is where flow and pressure ratio grow.
            distance_ratio: x.hypot(y) * (x + y).signum(),
            eta_difference: node.eta - between(|n| n.eta),
            before,
        })
    }

    fn compared(&self, node: &FittedNode) -> Option<ComparedPlace> {
        let found = self.nearest(node)?;
        let across = |n: &FittedNode| {
            (n.flow_standard_error_kg_s / self.flow_scale_kg_s)
                .hypot(n.pressure_ratio_standard_error / self.ratio_scale)
        };
        let (mut distance, mut eta) = (
            across(node).hypot(across(found.before)),
            node.eta_standard_error.hypot(found.before.eta_standard_error),
        );
        // What a gain or an offset does to all flows or pressure ratios of a map moves the place over the line.
        let flow_kg_s =
            node.flow_common_standard_error_kg_s.hypot(found.before.flow_common_standard_error_kg_s);
        let pressure_ratio = node
            .pressure_ratio_common_standard_error
            .hypot(found.before.pressure_ratio_common_standard_error);
        for (flow_kg_s, pressure_ratio) in [(flow_kg_s, 0.0), (0.0, pressure_ratio)] {
            let moved = [1.0, -1.0].into_iter().find_map(|sign| {
                self.nearest(&FittedNode {
                    flow_corrected_kg_s: node.flow_corrected_kg_s + sign * flow_kg_s,
                    pressure_ratio: node.pressure_ratio + sign * pressure_ratio,
                    ..*node
                })
            });
            if let Some(moved) = moved {
                distance = distance.hypot(moved.distance_ratio - found.distance_ratio);
                eta = eta.hypot(moved.eta_difference - found.eta_difference);
            }
        }
        Some(ComparedPlace {
            flow_corrected_kg_s: node.flow_corrected_kg_s,
            pressure_ratio: node.pressure_ratio,
            eta: node.eta,
            flow_difference_kg_s: found.flow_difference_kg_s,
            pressure_ratio_difference: found.pressure_ratio_difference,
            distance_ratio: found.distance_ratio,
            distance_standard_error_ratio: distance,
            eta_difference: found.eta_difference,
            eta_standard_error: eta,
        })
    }
}
