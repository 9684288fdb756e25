//! The smooth surface through a turbine map, with intervals.
//!
//! The flow parameter is a nozzle's, `sqrt(1 - ER^-1.1)`, times a polynomial in the logarithm of the expansion ratio, speed and vane
//! position. The efficiency is a polynomial in the blade-speed ratio, which a map gives up to a constant factor: the speed parameter
//! over the root of the isentropic drop (Watson and Janota, Turbocharging the Internal Combustion Engine, ch. 5).

use crate::table::reduced_turbine_point;
use crate::turbine::turbine_surface::{Observation, Place, Surface, Term};
use mapper_core::{
    Channel, DeclaredUncertainty, FittedTurbine, FittedTurbineLine, FittedTurbineNode, MeasuredTurbinePoint,
    TurbineCommonErrors, TurbineMap, TurbineMapPoint, TurbinePoint, Verdict,
};
use mapper_numerics::statistics::range;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::turbine::SWALLOWING_EXPONENT;
use serde::Serialize;
use std::collections::BTreeMap;

/// Terms of the flow over vane position, speed and ln ER, the most important first.
const FLOW_TERMS: [Term; 11] = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 0, 1],
    [0, 1, 0],
    [2, 0, 0],
    [0, 0, 2],
    [1, 0, 1],
    [0, 1, 1],
    [1, 1, 0],
    [0, 2, 0],
    [0, 0, 3],
];
/// Terms of the efficiency over vane position, speed and blade-speed ratio: a parabola first.
const EFFICIENCY_TERMS: [Term; 11] = [
    [0, 0, 0],
    [0, 0, 1],
    [0, 0, 2],
    [1, 0, 0],
    [0, 1, 0],
    [2, 0, 0],
    [1, 0, 1],
    [0, 1, 1],
    [1, 1, 0],
    [0, 2, 0],
    [0, 0, 3],
];
/// Usual inlet temperature of gas stands (600 degC), K. Bound: the exponent of the gas changes by only 4 % between 300 degC and 900 degC.
const USUAL_GAS_K: f64 = 873.15;
/// Minimum number of points. Bound: fewer determine only a constant and its scatter.
const MIN_POINTS: usize = 4;
/// Nodes over the expansion ratio. Bound: finer than the measured points.
const NODES: usize = 21;

/// Relative step of the derivative by the expansion ratio. Bound: between rounding and curvature.
const RATIO_STEP: f64 = 1e-6;

/// Why a turbine map cannot be fitted.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum TurbineFitError {
    #[error("the turbine map has {0} points; a fit needs at least 4, on lines of different speed")]
    TooFewPoints(usize),
}

/// A fitted turbine map.
#[derive(Debug, Clone)]
pub struct TurbineFit {
    flow: Surface,
    efficiency: Option<Surface>,
    ends: Vec<LineEnds>,
}

#[derive(Debug, Clone, Copy)]
struct LineEnds {
    vane_position: f64,
    speed: f64,
    lowest_ratio: f64,
    highest_ratio: f64,
}

/// Maximum relative distance outside the measured range that does not count as extrapolated. Bound: stands hold speeds and pressures
/// within 1 %.
const END_TOLERANCE_RATIO: f64 = 0.01;

fn vane(point: &TurbineMapPoint) -> f64 {
    point.vane_position.unwrap_or(0.0)
}

fn nozzle(expansion_ratio: f64) -> f64 {
    0.5 * (1.0 - expansion_ratio.powf(SWALLOWING_EXPONENT)).ln()
}

fn flow_place(vane_position: f64, speed: f64, expansion_ratio: f64) -> Place {
    [vane_position, speed, expansion_ratio.ln()]
}

fn efficiency_place(vane_position: f64, speed: f64, expansion_ratio: f64) -> Place {
    let drop = 1.0 - expansion_ratio.powf(-Air::DRY.isentropic_exponent(USUAL_GAS_K));
    [vane_position, speed, speed / drop.sqrt()]
}

/// Changes of the flow's logarithm at the same expansion ratio: a wrong ratio moves the point along the curve.
fn flow_changes(errors: &TurbineCommonErrors, expansion_ratio: f64) -> Vec<f64> {
    let slope = (nozzle(expansion_ratio * (1.0 + RATIO_STEP)) - nozzle(expansion_ratio)) / RATIO_STEP;
    let changes = errors.ln_flow_changes.iter().zip(&errors.ln_expansion_ratio_changes);
    changes.map(|(ln_flow, ln_ratio)| ln_flow - slope * ln_ratio).collect()
}

impl TurbineFit {
    /// Fits a map.
    pub fn new(map: &TurbineMap) -> Result<TurbineFit, TurbineFitError> {
        TurbineFit::with_common_errors(map, &[])
    }

    /// Fits a map whose points share errors, one for each point in order; none if empty.
    pub fn with_common_errors(
        map: &TurbineMap,
        common: &[&TurbineCommonErrors],
    ) -> Result<TurbineFit, TurbineFitError> {
        let mut common = common.iter();
        let mut flow = Vec::new();
        let mut efficiency = Vec::new();
        let mut ends = Vec::new();
        for (line, points) in map.lines().enumerate() {
            for point in points {
                let (speed, ratio) = (point.speed_parameter_rpm_sqrt_k, point.expansion_ratio);
                let value = point.flow_parameter_kg_sqrt_k_s_kpa.ln() - nozzle(ratio);
                let errors = common.next();
                let changes = errors.map_or_else(Vec::new, |errors| flow_changes(errors, ratio));
                flow.push(Observation { place: flow_place(vane(point), speed, ratio), value, line, changes });
                let place = efficiency_place(vane(point), speed, ratio);
                let changes = errors.map_or_else(Vec::new, |errors| errors.efficiency_changes.clone());
                efficiency.extend(point.efficiency.map(|value| Observation { place, value, line, changes }));
            }
            ends.extend(line_ends(points));
        }
        let too_few = TurbineFitError::TooFewPoints(flow.len());
        if flow.len() < MIN_POINTS {
            return Err(too_few);
        }
        Ok(TurbineFit {
            flow: Surface::fit(&flow, &FLOW_TERMS).ok_or(too_few)?,
            efficiency: Surface::fit(&efficiency, &EFFICIENCY_TERMS),
            ends,
        })
    }

    /// Flow and efficiency at a place, with their intervals.
    pub fn at(&self, vane_position: Option<f64>, speed: f64, expansion_ratio: f64) -> FittedTurbineNode {
        let vane = vane_position.unwrap_or(0.0);
        let place = flow_place(vane, speed, expansion_ratio);
        let (log, half) = (self.flow.value(place) + nozzle(expansion_ratio), self.flow.half_width(place));
        let place = efficiency_place(vane, speed, expansion_ratio);
        let efficiency =
            self.efficiency.as_ref().map(|surface| (surface.value(place), surface.half_width(place)));
        FittedTurbineNode {
            expansion_ratio,
            flow_parameter_kg_sqrt_k_s_kpa: log.exp(),
            flow_low: (log - half).exp(),
            flow_high: (log + half).exp(),
            efficiency: efficiency.map(|(value, _)| value),
            efficiency_low: efficiency.map(|(value, half)| value - half),
            efficiency_high: efficiency.map(|(value, half)| value + half),
            extrapolated: self.is_extrapolated(vane, speed, expansion_ratio),
        }
    }

    /// Standard errors of a measurement at a place: of the flow's logarithm and of the efficiency.
    pub(crate) fn standard_errors(&self, point: &TurbineMapPoint) -> (f64, Option<f64>) {
        let (speed, ratio) = (point.speed_parameter_rpm_sqrt_k, point.expansion_ratio);
        let flow = self.flow.standard_error(flow_place(vane(point), speed, ratio));
        let place = efficiency_place(vane(point), speed, ratio);
        (flow, self.efficiency.as_ref().map(|surface| surface.standard_error(place)))
    }

    /// Whether a place is outside the ranges of the lines at the nearest vane position, which are linear between their speeds.
    fn is_extrapolated(&self, vane_position: f64, speed: f64, expansion_ratio: f64) -> bool {
        let distance = |ends: &LineEnds| (ends.vane_position - vane_position).abs();
        let vanes = || self.ends.iter().map(|ends| ends.vane_position);
        let (low, high) = range(vanes());
        if vane_position < low || vane_position > high {
            return true;
        }
        let nearest = self.ends.iter().map(distance).fold(f64::INFINITY, f64::min);
        let lines: Vec<&LineEnds> = self.ends.iter().filter(|ends| distance(ends) <= nearest).collect();
        let below = lines.iter().rev().find(|ends| ends.speed <= speed * (1.0 + END_TOLERANCE_RATIO));
        let above = lines.iter().find(|ends| ends.speed >= speed * (1.0 - END_TOLERANCE_RATIO));
        let (Some(below), Some(above)) = (below, above) else { return true };
        let span = above.speed - below.speed;
        let share = if span > 0.0 { ((speed - below.speed) / span).clamp(0.0, 1.0) } else { 0.0 };
        let lowest = below.lowest_ratio + share * (above.lowest_ratio - below.lowest_ratio);
        let highest = below.highest_ratio + share * (above.highest_ratio - below.highest_ratio);
        expansion_ratio < lowest * (1.0 - END_TOLERANCE_RATIO)
            || expansion_ratio > highest * (1.0 + END_TOLERANCE_RATIO)
    }

    /// The surface as a table over the measured speeds and evenly spaced expansion ratios.
    pub fn table(&self, map: &TurbineMap) -> FittedTurbine {
        let lowest = self.ends.iter().map(|ends| ends.lowest_ratio).fold(f64::INFINITY, f64::min);
        let highest = self.ends.iter().map(|ends| ends.highest_ratio).fold(0.0, f64::max);
        let ratio = |node: usize| lowest + (highest - lowest) * node as f64 / (NODES - 1) as f64;
        let lines = map.lines().zip(&self.ends).map(|(points, ends)| {
            let vane_position = points.first().and_then(|point| point.vane_position);
            FittedTurbineLine {
                vane_position,
                speed_parameter_rpm_sqrt_k: ends.speed,
                nodes: (0..NODES).map(|node| self.at(vane_position, ends.speed, ratio(node))).collect(),
            }
        });
        FittedTurbine {
            lines: lines.collect(),
            flow_error_rms_ratio: self.flow.left_out_rms,
            efficiency_error_rms: self.efficiency.as_ref().map(|surface| surface.left_out_rms),
        }
    }
}

fn line_ends(points: &[TurbineMapPoint]) -> Option<LineEnds> {
    let speed =
        points.iter().map(|point| point.speed_parameter_rpm_sqrt_k).sum::<f64>() / points.len() as f64;
    let (lowest_ratio, highest_ratio) = range(points.iter().map(|point| point.expansion_ratio));
    Some(LineEnds { vane_position: vane(points.first()?), speed, lowest_ratio, highest_ratio })
}

/// The map with its fitted table.
pub fn fit_turbine(map: TurbineMap) -> Result<TurbineMap, TurbineFitError> {
    let fitted = TurbineFit::new(&map)?.table(&map);
    Ok(TurbineMap { fitted: Some(fitted), ..map })
}

/// The map of the turbine at the points of a compressor test, without those that are unusable, with a fitted surface whose intervals contain the
/// errors that all points share.
pub fn identified_turbine_map(
    machine: &str,
    points: &[&TurbinePoint],
) -> Result<TurbineMap, TurbineFitError> {
    let mut ordered = turbine_points_by_line(points);
    ordered.retain(|point| point.verdict != Verdict::Unusable);
    let point = |point: &&TurbinePoint| TurbineMapPoint {
        vane_position: point.vane_position,
        speed_parameter_rpm_sqrt_k: point.speed_parameter_rpm_sqrt_k,
        flow_parameter_kg_sqrt_k_s_kpa: point.flow_parameter_kg_sqrt_k_s_kpa,
        expansion_ratio: point.expansion_ratio,
        efficiency: point.efficiency,
    };
    let map =
        TurbineMap { machine: machine.to_owned(), points: ordered.iter().map(point).collect(), fitted: None };
    let common: Vec<&TurbineCommonErrors> = ordered.iter().map(|point| &point.common).collect();
    let fitted = TurbineFit::with_common_errors(&map, &common)?.table(&map);
    Ok(TurbineMap { fitted: Some(fitted), ..map })
}

/// The points of each speed line in order of expansion, the slowest line first.
pub fn turbine_points_by_line<'a>(points: &[&'a TurbinePoint]) -> Vec<&'a TurbinePoint> {
    let mut ordered = points.to_vec();
    ordered.sort_by(|a, b| a.speed_parameter_rpm_sqrt_k.total_cmp(&b.speed_parameter_rpm_sqrt_k));
    // The speeds within a line vary by a per cent.
    let lines = ordered.chunk_by_mut(|a, b| {
        b.speed_parameter_rpm_sqrt_k <= TurbineMap::SAME_LINE_RATIO * a.speed_parameter_rpm_sqrt_k
    });
    lines.for_each(|line| line.sort_by(|a, b| a.expansion_ratio.total_cmp(&b.expansion_ratio)));
    ordered
}

/// A point of a turbine map with its standard uncertainties.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReducedTurbinePoint {
    /// The point.
    #[serde(flatten)]
    pub point: TurbineMapPoint,
    /// Standard uncertainty of the flow parameter, kg K^0.5/(s kPa).
    pub flow_standard_error: f64,
    /// Standard uncertainty of the efficiency, fraction.
    pub efficiency_standard_error: Option<f64>,
}

type Reading = fn(&mut MeasuredTurbinePoint) -> Option<&mut f64>;

/// The readings that flow and efficiency depend on.
const READINGS: [(Channel, Reading); 5] = [
    (Channel::T3, |point| Some(&mut point.t3_k)),
    (Channel::P3, |point| Some(&mut point.p3_pa)),
    (Channel::P4, |point| Some(&mut point.p4_pa)),
    (Channel::T4, |point| point.t4_k.as_mut()),
    (Channel::TurbineFlow, |point| Some(&mut point.flow_kg_s)),
];

/// The points of a turbine map, in order. Each sensor is moved by one standard deviation, and the point is computed again.
pub fn reduce_turbine(
    measured: &[MeasuredTurbinePoint],
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> Vec<ReducedTurbinePoint> {
    measured.iter().map(|point| reduced(point, declared)).collect()
}

fn reduced(
    measured: &MeasuredTurbinePoint,
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> ReducedTurbinePoint {
    let point = reduced_turbine_point(measured);
    let (mut of_flow, mut of_efficiency) = (0.0_f64, 0.0_f64);
    for (channel, reading) in READINGS {
        let declared = declared.get(&channel).copied().unwrap_or_default();
        let mut moved = *measured;
        let Some(value) = reading(&mut moved) else { continue };
        *value += declared.fixed_sigma(channel, *value);
        let moved = reduced_turbine_point(&moved);
        of_flow = of_flow.hypot(moved.flow_parameter_kg_sqrt_k_s_kpa - point.flow_parameter_kg_sqrt_k_s_kpa);
        let change = moved.efficiency.zip(point.efficiency).map_or(0.0, |(moved, eta)| moved - eta);
        of_efficiency = of_efficiency.hypot(change);
    }
    ReducedTurbinePoint {
        point,
        flow_standard_error: of_flow,
        efficiency_standard_error: point.efficiency.map(|_| of_efficiency),
    }
}
