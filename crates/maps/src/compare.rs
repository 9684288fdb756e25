//! Compares maps of compressors and of turbines, and the ends of their lines.

use crate::assemble::convert_efficiency;
use crate::map_fit::{MIN_FLOW_KG_S, MIN_RATIO_RANGE, MapFit, MapFitError, MapFitOptions};
use crate::turbine::turbine_fit::{TurbineFit, TurbineFitError};
use mapper_core::{
    CompressorMap, EndEvidence, FittedLine, FittedNode, LineEnd, MapPoint, SpeedLine, TurbineMap,
    TurbineMapPoint, Warning, confidence_interval_95,
};
use mapper_numerics::polyline::NearestOnPolyline;
use mapper_numerics::statistics::{mean, rms};
use serde::Serialize;

/// Relative difference of the speeds of one line. Bound: half of what stands hold.
const SAME_LINE_RATIO: f64 = 0.005;

/// Compared places on each line. Bound: more show nothing new between smooth lines.
const PLACES: usize = 25;
/// Nodes of the fitted lines for each compared place. Bound: the nearest place is then between nodes a hundredth of a line apart.
const NODES_PER_PLACE: usize = 4;
/// Maximum relative difference between the speeds of end lines that count as equal. Bound: stands hold a speed within 1 %.
pub(crate) const END_TOLERANCE_RATIO: f64 = 0.01;

/// A place of the second map compared with the nearest place of the first at equal corrected speed. Differences: second minus
/// first.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaceComparison {
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
    /// Distance across the line, in units of the first line's maximum flow and maximum PR - 1, positive outwards.
    pub distance_ratio: f64,
    /// Standard error of the distance from both maps, in the same units; it includes gains and offsets that each map's points share.
    pub distance_standard_error_ratio: f64,
    /// Difference of efficiency, fraction.
    pub eta_difference: f64,
    /// Standard error of the difference of efficiency from both maps, fraction.
    pub eta_standard_error: f64,
}

impl PlaceComparison {
    /// Whether the 95 % interval of the distance excludes 0.
    pub fn line_differs(&self) -> bool {
        excludes_zero(self.distance_ratio, self.distance_standard_error_ratio)
    }

    /// Whether the 95 % interval of the difference of efficiency excludes 0.
    pub fn eta_differs(&self) -> bool {
        excludes_zero(self.eta_difference, self.eta_standard_error)
    }
}

fn excludes_zero(difference: f64, standard_error: f64) -> bool {
    let (low, high) = confidence_interval_95(difference, standard_error);
    low > 0.0 || high < 0.0
}

/// Comparison of both maps along one speed line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpeedLineComparison {
    /// Corrected speed, rpm, at the first map's reference state.
    pub speed_corrected_rpm: f64,
    /// Places from the choke side to the surge side; empty if the lines do not overlap.
    pub places: Vec<PlaceComparison>,
}

/// Comparison of two compressor maps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapComparison {
    /// Lines in order of speed.
    pub lines: Vec<SpeedLineComparison>,
    /// Speeds of either map outside the other's range, rpm.
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

impl SpeedLineComparison {
    /// Shares of its places where the lines, and where the efficiencies, differ beyond their 95 % interval; `None` without places.
    pub fn differ_ratios(&self) -> Option<[f64; 2]> {
        let count = (!self.places.is_empty()).then_some(self.places.len() as f64)?;
        let differs = [PlaceComparison::line_differs, PlaceComparison::eta_differs];
        Some(differs.map(|differs| self.places.iter().filter(|place| differs(place)).count() as f64 / count))
    }
}

impl MapComparison {
    /// The larger of the shares of places where lines or efficiencies differ.
    pub fn differs_ratio(&self) -> f64 {
        self.line_differs_ratio.max(self.eta_differs_ratio)
    }
}

/// Compares the fits of two maps at every measured speed that both cover. The second map is converted to the first's reference state and,
/// if both state one, to its definition of efficiency. Extrapolated places are left out.
pub fn compare(first: &CompressorMap, second: &CompressorMap) -> Result<MapComparison, MapFitError> {
    let second = second.clone().at_reference(first.reference);
    // A difference of definitions is not a difference of machines.
    let second = match (second.efficiency, first.efficiency) {
        (Some(from), Some(to)) => convert_efficiency(second, from, to),
        _ => second,
    };
    let fits = [MapFit::new(first)?, MapFit::new(&second)?];
    let speeds = [corrected_speeds(first), corrected_speeds(&second)];
    let bounds =
        speeds.each_ref().map(|s| (s.first().copied().unwrap_or(0.0), s.last().copied().unwrap_or(0.0)));
    let (low, high) = (bounds[0].0.max(bounds[1].0), bounds[0].1.min(bounds[1].1));
    let within = |speed: &f64| *speed >= low && *speed <= high;
    // An end line slightly beyond the other map's is compared at the other map's end.
    let snap_to_end = |speed: &f64| {
        let nearest = speed.max(low).min(high);
        if (speed - nearest).abs() <= END_TOLERANCE_RATIO * nearest { nearest } else { *speed }
    };
    let mut all: Vec<f64> = speeds.iter().flatten().map(snap_to_end).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|b, a| *b <= *a * (1.0 + SAME_LINE_RATIO));
    let (common, not_compared_rpm): (Vec<f64>, Vec<f64>) = all.into_iter().partition(within);
    let options = MapFitOptions {
        further_speeds_rpm: Some(common.clone()),
        nodes: NODES_PER_PLACE * PLACES,
        leave_one_out: false,
    };
    let tables = [fits[0].table(&options)?, fits[1].table(&options)?];
    let line_at = |lines: &[FittedLine], speed: f64| {
        let near = |line: &&FittedLine| (line.speed_corrected_rpm - speed).abs();
        lines.iter().min_by(|a, b| near(a).total_cmp(&near(b))).cloned()
    };
    let lines: Vec<SpeedLineComparison> = common
        .iter()
        .filter_map(|speed| {
            let places =
                compare_lines(&line_at(&tables[0].lines, *speed)?, &line_at(&tables[1].lines, *speed)?);
            Some(SpeedLineComparison { speed_corrected_rpm: *speed, places })
        })
        .collect();
    Ok(summarise(lines, not_compared_rpm))
}

fn corrected_speeds(map: &CompressorMap) -> Vec<f64> {
    let mut speeds: Vec<f64> =
        map.lines.iter().map(|line| line.speed_corrected_rpm).filter(|s| s.is_finite() && *s > 0.0).collect();
    speeds.sort_by(f64::total_cmp);
    speeds
}

fn summarise(lines: Vec<SpeedLineComparison>, not_compared_rpm: Vec<f64>) -> MapComparison {
    let places = || lines.iter().flat_map(|line| &line.places);
    let count = places().count().max(1) as f64;
    let mean = |value: fn(&PlaceComparison) -> f64| places().map(value).sum::<f64>() / count;
    let share =
        |differs: fn(&PlaceComparison) -> bool| places().filter(|p| differs(p)).count() as f64 / count;
    MapComparison {
        distance_rms_ratio: mean(|p| p.distance_ratio.powi(2)).sqrt(),
        eta_difference_rms: mean(|p| p.eta_difference.powi(2)).sqrt(),
        eta_difference_mean: mean(|p| p.eta_difference),
        line_differs_ratio: share(PlaceComparison::line_differs),
        eta_differs_ratio: share(PlaceComparison::eta_differs),
        lines,
        not_compared_rpm,
    }
}

fn compare_lines(first: &FittedLine, second: &FittedLine) -> Vec<PlaceComparison> {
    let known: Vec<&FittedNode> = first.nodes.iter().filter(|n| !n.extrapolated).collect();
    let flow_scale_kg_s = known.iter().map(|n| n.flow_corrected_kg_s).fold(MIN_FLOW_KG_S, f64::max);
    let ratio_scale = known.iter().map(|n| n.pressure_ratio - 1.0).fold(MIN_RATIO_RANGE, f64::max);
    let line = ReferenceLine { nodes: &known, flow_scale_kg_s, ratio_scale };
    let nodes = second.nodes.iter().step_by(NODES_PER_PLACE).filter(|node| !node.extrapolated);
    nodes.filter_map(|node| line.compare_place(node)).collect()
}

/// Deviation of a node of the second map from the nearest place of the first line.
struct NearestDeviation<'a> {
    /// Second minus first.
    flow_difference_kg_s: f64,
    pressure_ratio_difference: f64,
    distance_ratio: f64,
    eta_difference: f64,
    before: &'a FittedNode,
}

/// The first map's line, with the units of distances from it.
struct ReferenceLine<'a> {
    nodes: &'a [&'a FittedNode],
    flow_scale_kg_s: f64,
    ratio_scale: f64,
}

impl ReferenceLine<'_> {
    /// Deviation from the nearest place; `None` if that is an end of the line, since only the other map covers the node then.
    fn nearest(&self, node: &FittedNode) -> Option<NearestDeviation<'_>> {
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
        Some(NearestDeviation {
            flow_difference_kg_s,
            pressure_ratio_difference,
            // Outwards: towards larger flow and pressure ratio.
            distance_ratio: x.hypot(y) * (x + y).signum(),
            eta_difference: node.eta - between(|n| n.eta),
            before,
        })
    }

    fn compare_place(&self, node: &FittedNode) -> Option<PlaceComparison> {
        let deviation = self.nearest(node)?;
        let across = |n: &FittedNode| {
            (n.flow_standard_error_kg_s / self.flow_scale_kg_s)
                .hypot(n.pressure_ratio_standard_error / self.ratio_scale)
        };
        let (mut distance, mut eta) = (
            across(node).hypot(across(deviation.before)),
            node.eta_standard_error.hypot(deviation.before.eta_standard_error),
        );
        // A gain or offset common to all flows or pressure ratios of a map moves the place across the line.
        let flow_kg_s =
            node.flow_common_standard_error_kg_s.hypot(deviation.before.flow_common_standard_error_kg_s);
        let pressure_ratio = node
            .pressure_ratio_common_standard_error
            .hypot(deviation.before.pressure_ratio_common_standard_error);
        for (flow_kg_s, pressure_ratio) in [(flow_kg_s, 0.0), (0.0, pressure_ratio)] {
            let moved = [1.0, -1.0].into_iter().find_map(|sign| {
                self.nearest(&FittedNode {
                    flow_corrected_kg_s: node.flow_corrected_kg_s + sign * flow_kg_s,
                    pressure_ratio: node.pressure_ratio + sign * pressure_ratio,
                    ..*node
                })
            });
            if let Some(moved) = moved {
                distance = distance.hypot(moved.distance_ratio - deviation.distance_ratio);
                eta = eta.hypot(moved.eta_difference - deviation.eta_difference);
            }
        }
        Some(PlaceComparison {
            flow_corrected_kg_s: node.flow_corrected_kg_s,
            pressure_ratio: node.pressure_ratio,
            eta: node.eta,
            flow_difference_kg_s: deviation.flow_difference_kg_s,
            pressure_ratio_difference: deviation.pressure_ratio_difference,
            distance_ratio: deviation.distance_ratio,
            distance_standard_error_ratio: distance,
            eta_difference: deviation.eta_difference,
            eta_standard_error: eta,
        })
    }
}

/// Efficiency below which a compressor counts as choked (Garrett, Turbo Tech 103). Source: Garrett, Turbo Tech 103.
const MAX_CHOKE_ETA: f64 = 0.58;
/// Maximum relative rise of flow over the relative loss of pressure rise on the vertical part of a line. It is above 1 at the zero-slope
/// point and approaches 0 in choke. Bound: it is above 1 at the zero-slope point and approaches 0 in choke.
const MAX_VERTICAL_SLOPE_RATIO: f64 = 0.1;
/// Minimum loss of pressure rise, ratio. Bound: large compared with the scatter of repeated points, 0.2 %.
const MIN_PRESSURE_LOSS_RATIO: f64 = 0.05;
/// Maximum relative difference in flow of a repeated point. Bound: twice the usual uncertainty of a flow meter, 0.5 %.
const REPEAT_RATIO: f64 = 0.01;

/// An end of a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DetectedEnd {
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio.
    pub pressure_ratio: f64,
    /// Evidence.
    pub by: EndEvidence,
}

/// Both ends of a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineEnds {
    /// Corrected speed of the line, rpm.
    pub speed_corrected_rpm: f64,
    /// Side of the smallest flow.
    pub surge: DetectedEnd,
    /// Side of the largest flow.
    pub choke: DetectedEnd,
}

/// Detects the ends of every line, and marks their points. `named` returns the end that the table states for a step.
pub fn mark_line_ends(map: &mut CompressorMap, named: impl Fn(usize) -> Option<LineEnd>) -> Vec<LineEnds> {
    let mut ends = Vec::new();
    for line in &mut map.lines {
        let place =
            |end: LineEnd| line.points.iter().position(|point| named(point.identified.step) == Some(end));
        let last = line.points.len().saturating_sub(1);
        let (surge_at, surge_by) = match place(LineEnd::Surge) {
            Some(at) => (at, EndEvidence::Named),
            None => (0, surge_evidence(line)),
        };
        let (choke_at, choke_by) = match place(LineEnd::Choke) {
            Some(at) => (at, EndEvidence::Named),
            None => choke_evidence(line).unwrap_or((last, EndEvidence::NotReached)),
        };
        let end = |at: usize, by: EndEvidence| {
            let point = line.points.get(at)?;
            let (flow_corrected_kg_s, pressure_ratio) = (point.flow_corrected_kg_s, point.pressure_ratio);
            Some(DetectedEnd { flow_corrected_kg_s, pressure_ratio, by })
        };
        let Some((surge, choke)) = end(surge_at, surge_by).zip(end(choke_at, choke_by)) else { continue };
        ends.push(LineEnds { speed_corrected_rpm: line.speed_corrected_rpm, surge, choke });
        mark(line.points.get_mut(surge_at), surge_by, |evidence| Warning::SurgeEnd { evidence });
        mark(line.points.get_mut(choke_at), choke_by, |evidence| Warning::ChokeEnd { evidence });
    }
    ends
}

fn surge_evidence(line: &SpeedLine) -> EndEvidence {
    let Some(first) = line.points.first() else { return EndEvidence::NotReached };
    let is_next =
        |point: &&MapPoint| point.flow_corrected_kg_s > (1.0 + REPEAT_RATIO) * first.flow_corrected_kg_s;
    match line.points.iter().find(is_next) {
        Some(next) if first.pressure_ratio <= next.pressure_ratio => EndEvidence::ZeroSlope,
        _ => EndEvidence::NotReached,
    }
}

/// The first point in choke, towards larger flow.
fn choke_evidence(line: &SpeedLine) -> Option<(usize, EndEvidence)> {
    let best = line.points.iter().filter_map(|point| point.eta).fold(0.0, f64::max);
    let top = line.points.iter().map(|point| point.pressure_ratio).fold(1.0, f64::max);
    let peak = line.points.iter().position(|point| point.eta == Some(best)).unwrap_or(0);
    let evidence = |(at, point): (usize, &MapPoint)| {
        // Heat keeps the apparent efficiency of slow lines below the limit everywhere: only the slope indicates choke there.
        if at > peak && best >= MAX_CHOKE_ETA && point.eta.is_some_and(|eta| eta < MAX_CHOKE_ETA) {
            return Some((at, EndEvidence::Efficiency));
        }
        let loss_ratio = |other: &MapPoint| (other.pressure_ratio - point.pressure_ratio) / (top - 1.0);
        let above =
            line.points.get(..at)?.iter().rev().find(|other| loss_ratio(other) >= MIN_PRESSURE_LOSS_RATIO)?;
        let flow_rise_ratio = point.flow_corrected_kg_s / above.flow_corrected_kg_s - 1.0;
        (flow_rise_ratio < MAX_VERTICAL_SLOPE_RATIO * loss_ratio(above))
            .then_some((at, EndEvidence::Vertical))
    };
    line.points.iter().enumerate().find_map(evidence)
}

fn mark(point: Option<&mut MapPoint>, evidence: EndEvidence, warning: fn(EndEvidence) -> Warning) {
    if let Some(point) = point.filter(|_| evidence != EndEvidence::NotReached) {
        point.identified.warnings.push(warning(evidence));
    }
}

/// A point of the second map compared with the first. Differences: second minus first.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TurbinePointComparison {
    /// The point.
    pub point: TurbineMapPoint,
    /// Difference of flow, fraction of the first's.
    pub flow_difference_ratio: f64,
    /// Its standard error, both maps together.
    pub flow_standard_error_ratio: f64,
    /// Difference of efficiency, fraction.
    pub efficiency_difference: Option<f64>,
    /// Its standard error.
    pub efficiency_standard_error: Option<f64>,
}

/// Comparison of two turbine maps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TurbineComparison {
    /// Points of the second map within the first.
    pub points: Vec<TurbinePointComparison>,
    /// Number of points outside the first map.
    pub not_compared: usize,
    /// Mean difference of flow, fraction; `None` without common places.
    pub flow_difference_mean_ratio: Option<f64>,
    /// Root mean square of the difference of flow.
    pub flow_difference_rms_ratio: Option<f64>,
    /// Mean difference of efficiency, fraction.
    pub efficiency_difference_mean: Option<f64>,
    /// Root mean square of the difference of efficiency.
    pub efficiency_difference_rms: Option<f64>,
    /// Share of points whose flow differs beyond its 95 % interval.
    pub flow_differs_ratio: f64,
    /// Share of points whose efficiency differs beyond its 95 % interval.
    pub efficiency_differs_ratio: f64,
}

/// Compares two maps.
pub fn compare_turbines(
    first: &TurbineMap,
    second: &TurbineMap,
) -> Result<TurbineComparison, TurbineFitError> {
    let fit = TurbineFit::new(first)?;
    let places = second.points.iter().map(|point| {
        (point, fit.at(point.vane_position, point.speed_parameter_rpm_sqrt_k, point.expansion_ratio))
    });
    let (outside, inside): (Vec<_>, Vec<_>) = places.partition(|(_, place)| place.extrapolated);
    let points: Vec<TurbinePointComparison> = inside
        .into_iter()
        .map(|(point, place)| {
            // The standard error is that of a measurement, so it includes the scatter of the second map.
            let (flow_standard_error_ratio, efficiency_standard_error) = fit.standard_errors(point);
            let flow = point.flow_parameter_kg_sqrt_k_s_kpa / place.flow_parameter_kg_sqrt_k_s_kpa;
            TurbinePointComparison {
                point: *point,
                flow_difference_ratio: flow - 1.0,
                flow_standard_error_ratio,
                efficiency_difference: point.efficiency.zip(place.efficiency).map(|(own, first)| own - first),
                efficiency_standard_error,
            }
        })
        .collect();
    let flows = || points.iter().map(|point| point.flow_difference_ratio);
    let efficiencies = || points.iter().filter_map(|point| point.efficiency_difference);
    let share = |pairs: Vec<(f64, f64)>| {
        let differs = |(difference, error): &&(f64, f64)| excludes_zero(*difference, *error);
        pairs.iter().filter(differs).count() as f64 / pairs.len().max(1) as f64
    };
    let flow_pairs = points.iter().map(|p| (p.flow_difference_ratio, p.flow_standard_error_ratio)).collect();
    let efficiency_pairs =
        points.iter().filter_map(|p| p.efficiency_difference.zip(p.efficiency_standard_error)).collect();
    Ok(TurbineComparison {
        not_compared: outside.len(),
        flow_difference_mean_ratio: mean(flows()),
        flow_difference_rms_ratio: rms(flows()),
        efficiency_difference_mean: mean(efficiencies()),
        efficiency_difference_rms: rms(efficiencies()),
        flow_differs_ratio: share(flow_pairs),
        efficiency_differs_ratio: share(efficiency_pairs),
        points,
    })
}
