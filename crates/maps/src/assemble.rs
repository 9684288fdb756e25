//! Assembles a map from points: repeated points become one, with one definition of efficiency.

use mapper_core::{
    CompressorMap, EfficiencyDefinition, EstimateUncertainty, IdentifiedPoint, MapPoint, Method,
    OperatingPoint, ReferenceState, SpeedLine, SpeedShift, StepKind, StepMarker, Verdict, step_number,
    with_unit,
};
use mapper_numerics::statistics::range;
use mapper_physics::compressor_map::closed_form_map::at_speed;
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::laws::compression::efficiency_by;
use serde::Serialize;

/// Assembles a map from identified points.
///
/// Similarity moves each point from its own corrected speed to the mean speed of its line. The change is stored in
/// [`MapPoint::shift`], the measured point in [`MapPoint::identified`].
///
/// Points with a target form a line per target speed; points without one are grouped by gaps in corrected speed. Lines come in order of mean corrected speed, their points in order of corrected flow (then of
/// falling pressure ratio, for the vertical part at choke). Repeats for the detection of
/// drift are left out unless the point itself has no efficiency. An unusable point keeps
/// flow and pressure ratio, without `eta`.
///
/// `reference` is the reference state of the points' corrected quantities, `method` the method that identified all of them.
pub fn assemble(
    points: &[IdentifiedPoint],
    machine: &str,
    reference: ReferenceState,
    method: Method,
) -> Result<CompressorMap, AssembleError> {
    let points = &points_for_map(points);
    if points.is_empty() {
        return Err(AssembleError::NoPoints);
    }
    points.iter().try_for_each(|point| check_point(point, method))?;
    let mut lines: Vec<SpeedLine> = group_by_speed(points).iter().map(line_of_group).collect();
    lines.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    Ok(CompressorMap {
        machine: machine.to_owned(),
        reference,
        method,
        efficiency: None,
        gas: None,
        wheel_diameter_m: None,
        lines,
        surge: Vec::new(),
        fitted: None,
    })
}

fn check_point(point: &IdentifiedPoint, method: Method) -> Result<(), AssembleError> {
    let step = point.step;
    if point.method != method {
        return Err(AssembleError::MixedMethods { step, expected: method, found: point.method });
    }
    for (quantity, value, unit) in [
        ("corrected mass flow", point.flow_corrected_kg_s, "kg/s"),
        ("pressure ratio", point.pressure_ratio, "(ratio)"),
        ("corrected speed", point.speed_corrected_rpm, "rpm"),
    ] {
        if !value.is_finite() {
            return Err(AssembleError::NotFinite { step, quantity, value, unit });
        }
    }
    Ok(())
}

fn line_of_group(group: &Group<'_>) -> SpeedLine {
    let speeds_rpm = group.points.iter().map(|point| point.speed_corrected_rpm);
    let mean_rpm = speeds_rpm.sum::<f64>() / group.points.len() as f64;
    let points = group.points.iter().map(|point| move_to_speed(point, mean_rpm)).collect();
    SpeedLine { target_speed_rpm: group.target_speed_rpm, ..line(mean_rpm, points) }
}

/// A speed line with its points in order of flow.
pub fn line(speed_corrected_rpm: f64, mut points: Vec<MapPoint>) -> SpeedLine {
    let (slowest_rpm, fastest_rpm) = range(points.iter().map(|point| point.identified.speed_corrected_rpm));
    points.sort_by(|a, b| {
        let by_flow = a.flow_corrected_kg_s.total_cmp(&b.flow_corrected_kg_s);
        by_flow.then(b.pressure_ratio.total_cmp(&a.pressure_ratio))
    });
    let speed_spread_rpm = fastest_rpm - slowest_rpm;
    SpeedLine { speed_corrected_rpm, speed_spread_rpm, target_speed_rpm: None, points }
}

pub(crate) fn move_to_speed(point: &IdentifiedPoint, line_speed_rpm: f64) -> MapPoint {
    let (flow_kg_s, pressure_ratio) = (point.flow_corrected_kg_s, point.pressure_ratio);
    let shift_rpm = line_speed_rpm - point.speed_corrected_rpm;
    // Similarity is undefined for a shaft at rest.
    let is_moved = shift_rpm != 0.0 && point.speed_corrected_rpm > 0.0 && pressure_ratio > 0.0;
    let (flow_at_line_kg_s, ratio_at_line) = if is_moved {
        at_speed(flow_kg_s, pressure_ratio, line_speed_rpm / point.speed_corrected_rpm)
    } else {
        (flow_kg_s, pressure_ratio)
    };
    MapPoint {
        flow_corrected_kg_s: flow_at_line_kg_s,
        pressure_ratio: ratio_at_line,
        eta: point.eta.filter(|eta| point.verdict != Verdict::Unusable && eta.is_finite()),
        identified: point.clone(),
        shift: is_moved.then_some(SpeedShift {
            speed_corrected_rpm: shift_rpm,
            flow_corrected_kg_s: flow_at_line_kg_s - flow_kg_s,
            pressure_ratio: ratio_at_line - pressure_ratio,
        }),
    }
}

/// Why a map cannot be assembled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum AssembleError {
    #[error("there are no points to make a map of; identify at least one step first")]
    NoPoints,
    #[error(
        "step {}: {quantity} is {}, so the point has no place on the map; exclude the step, or correct the channel",
        step_number(*step),
        with_unit(value, unit)
    )]
    NotFinite { step: usize, quantity: &'static str, value: f64, unit: &'static str },
    #[error(
        "step {} was identified by `{found}`, the map is `{expected}`; identify all points by one method",
        step_number(*step)
    )]
    MixedMethods { step: usize, expected: Method, found: Method },
}

/// Relative difference of equal target speeds. Bound: targets are setpoints, which differ by rounding only.
const TARGET_ROUNDING_RATIO: f64 = 1e-6;

/// Minimum gap between neighbouring lines of points without a target speed, as a ratio of the slower corrected speed. Bound: it separates
/// lines of maps, which are at least 8 % apart, from the variation within one: 1 % with speed control, and some 2 % without.
const SPEED_GAP_RATIO: f64 = 0.04;

/// Points of one line in their original order, with their common target.
pub(crate) struct Group<'a> {
    pub target_speed_rpm: Option<f64>,
    pub points: Vec<&'a IdentifiedPoint>,
}

/// Groups points with a target by its speed, and all others by gaps in corrected speed. Every point is in exactly one group.
fn group_by_speed(points: &[IdentifiedPoint]) -> Vec<Group<'_>> {
    let (mut with_target, mut without_target): (Vec<_>, Vec<_>) =
        points.iter().partition(|point| target_speed_rpm(point).is_some());
    // Stable sorts: equal points stay in the order of measurement.
    with_target.sort_by(|a, b| {
        let key = |p: &IdentifiedPoint| target_speed_rpm(p).unwrap_or_default();
        key(a).total_cmp(&key(b))
    });
    without_target.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let mut groups = split(with_target, |a, b| {
        let (a, b) = (target_speed_rpm(a).unwrap_or_default(), target_speed_rpm(b).unwrap_or_default());
        b - a > TARGET_ROUNDING_RATIO * a.abs()
    });
    for group in &mut groups {
        group.target_speed_rpm = group.points.first().and_then(|point| target_speed_rpm(point));
    }
    groups.extend(split(without_target, |a, b| {
        b.speed_corrected_rpm - a.speed_corrected_rpm > SPEED_GAP_RATIO * a.speed_corrected_rpm.abs()
    }));
    groups
}

fn target_speed_rpm(point: &IdentifiedPoint) -> Option<f64> {
    point.target.map(|target| target.speed_rpm).filter(|speed_rpm| speed_rpm.is_finite())
}

/// Splits a sorted list at each point that starts a new line after the previous one.
fn split<'a>(
    points: Vec<&'a IdentifiedPoint>,
    starts_line: impl Fn(&IdentifiedPoint, &IdentifiedPoint) -> bool,
) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for point in points {
        match groups.last_mut() {
            Some(group) if !group.points.last().is_some_and(|last| starts_line(last, point)) => {
                group.points.push(point)
            }
            _ => groups.push(Group { target_speed_rpm: None, points: vec![point] }),
        }
    }
    groups
}

/// Selects the points of the map, in their order: one for each planned point.
///
/// A point without a usable efficiency is replaced by the repeat of the same target with the best verdict and, among these, the smallest
/// 95 % interval. The first point of a campaign has no jump before it, so only the joint method gives it an efficiency. If it is visited
/// again for that reason, the better visit by the same rule counts: a mean would claim too small an interval, since the visits share errors.
pub(crate) fn points_for_map(points: &[IdentifiedPoint]) -> Vec<IdentifiedPoint> {
    let repeats = || {
        points.iter().filter(|point| point.kind != StepKind::Point && point.target.is_some() && usable(point))
    };
    let order = |a: &&IdentifiedPoint, b: &&IdentifiedPoint| {
        rank(a).cmp(&rank(b)).then(width(a).total_cmp(&width(b)))
    };
    points
        .iter()
        .filter(|point| point.kind == StepKind::Point)
        .map(|point| {
            let is_unusable = !usable(point);
            repeats()
                .filter(|other| {
                    other.target == point.target && (is_unusable || other.kind == StepKind::Return)
                })
                .chain((!is_unusable).then_some(point))
                .min_by(order)
                .unwrap_or(point)
                .clone()
        })
        .collect()
}

fn usable(point: &IdentifiedPoint) -> bool {
    point.verdict != Verdict::Unusable && point.eta.is_some_and(f64::is_finite)
}

fn rank(point: &IdentifiedPoint) -> u8 {
    u8::from(point.verdict != Verdict::Good)
}

/// Width of the interval; infinite without one.
fn width(point: &IdentifiedPoint) -> f64 {
    match (point.eta_low, point.eta_high) {
        (Some(low), Some(high)) => high - low,
        _ => f64::INFINITY,
    }
}

/// A jump that the run made more than once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatedJump {
    /// Start of the jump.
    pub from: OperatingPoint,
    /// Target of the jump.
    pub to: OperatingPoint,
    /// Indices of the steps, from 0; files have their numbers, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub steps: Vec<usize>,
    /// Efficiency of each step, fraction.
    pub eta: Vec<f64>,
    /// Last minus first efficiency, fraction.
    pub eta_change: f64,
    /// Standard error of this change from noise, fraction; fixed offsets cancel. `None` if an interval is missing.
    pub eta_change_standard_error: Option<f64>,
}

/// Finds the repeated jumps, with the efficiency each time; a point that the same jump reached counts too.
pub fn repeated_jumps(markers: &[StepMarker], points: &[IdentifiedPoint]) -> Vec<RepeatedJump> {
    let mut jumps: Vec<(OperatingPoint, OperatingPoint)> = Vec::new();
    for marker in markers.iter().filter(|marker| marker.kind == StepKind::Repeat) {
        if let Some(jump) = marker.from.zip(marker.to).filter(|jump| !jumps.contains(jump)) {
            jumps.push(jump);
        }
    }
    jumps
        .into_iter()
        .filter_map(|(from, to)| {
            let steps = markers.iter().filter(|marker| (marker.from, marker.to) == (Some(from), Some(to)));
            let found: Vec<(&IdentifiedPoint, f64)> = steps
                .filter_map(|marker| {
                    let point = points.iter().find(|point| point.step == marker.index)?;
                    Some((point, point.eta?))
                })
                .collect();
            let ((first, first_eta), (last, last_eta)) = (found.first()?, found.last()?);
            let noise = |point: &IdentifiedPoint| Some(point.eta_uncertainty?.noise_standard_error);
            (found.len() > 1).then(|| RepeatedJump {
                from,
                to,
                steps: found.iter().map(|(point, _)| point.step).collect(),
                eta: found.iter().map(|(_, eta)| *eta).collect(),
                eta_change: last_eta - first_eta,
                eta_change_standard_error: noise(first)
                    .zip(noise(last))
                    .map(|(first, last)| first.hypot(last)),
            })
        })
        .collect()
}

/// Converts the efficiencies of a map from the definition `from` to `to`, for equal temperatures of dry air from the map's reference
/// state. Intervals and standard errors keep their ratio to the efficiency; a fitted surface is dropped.
pub fn convert_efficiency(
    mut map: CompressorMap,
    from: EfficiencyDefinition,
    to: EfficiencyDefinition,
) -> CompressorMap {
    if from != to {
        let ReferenceState { t_ref_k, p_ref_pa } = map.reference;
        let air = Air::new(Gas::air(), 0.0).with_efficiency(from);
        for point in map.lines.iter_mut().flat_map(|line| &mut line.points) {
            if let Some(eta) = point.eta.filter(|eta| *eta > 0.0 && point.pressure_ratio > 1.0) {
                let air = air.between(p_ref_pa, point.pressure_ratio * p_ref_pa);
                scale_efficiency(point, efficiency_by(to, eta, point.pressure_ratio, t_ref_k, air) / eta);
            }
        }
        map.fitted = None;
    }
    map.efficiency = Some(to);
    map
}

/// Multiplies the efficiency of a point, with its interval and errors.
pub(crate) fn scale_efficiency(point: &mut MapPoint, ratio: f64) {
    let identified = &mut point.identified;
    let values = [&mut point.eta, &mut identified.eta, &mut identified.eta_low, &mut identified.eta_high];
    values.into_iter().flatten().for_each(|value| *value *= ratio);
    identified.eta_uncertainty = identified.eta_uncertainty.map(|uncertainty| EstimateUncertainty {
        noise_standard_error: ratio * uncertainty.noise_standard_error,
        bias_standard_error: ratio * uncertainty.bias_standard_error,
    });
    identified.common.eta_changes.iter_mut().for_each(|change| *change *= ratio);
}
