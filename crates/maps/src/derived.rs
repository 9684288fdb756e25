//! Maps made from maps: of a machine of another size, and of two parts that were measured apart.

use crate::assemble::{convert_efficiency, line, move_to_speed, scale_efficiency};
use crate::compare::{END_TOLERANCE_RATIO, MapComparison, compare};
use mapper_core::{CompressorMap, SpeedLine};
use mapper_numerics::statistics::range;
use serde::Serialize;

/// Factors on the quantities of a map, all above 0. That of the pressure ratio multiplies `PR - 1`, so that a machine at rest stays at PR 1
/// (the scalars of NPSS and pyCycle).
///
/// ```
/// let larger = mapper_maps::MapScale::of_size(1.2);
/// assert_eq!((larger.flow, larger.speed, larger.efficiency), (1.44, 1.0 / 1.2, 1.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MapScale {
    /// Factor on the corrected flow.
    pub flow: f64,
    /// Factor on `PR - 1`.
    pub pressure_ratio: f64,
    /// Factor on the efficiency.
    pub efficiency: f64,
    /// Factor on the corrected speed.
    pub speed: f64,
}

impl MapScale {
    /// A geometrically similar machine at equal blade Mach numbers: flow with the square of the size, speed with its inverse, efficiency and
    /// pressure ratio unchanged. Reynolds number and clearances are left out. `size_ratio`: its wheel diameter over that of the map.
    pub fn of_size(size_ratio: f64) -> Self {
        MapScale {
            flow: size_ratio * size_ratio,
            pressure_ratio: 1.0,
            efficiency: 1.0,
            speed: size_ratio.recip(),
        }
    }

    /// Both one after the other.
    pub fn and(self, other: MapScale) -> Self {
        MapScale {
            flow: self.flow * other.flow,
            pressure_ratio: self.pressure_ratio * other.pressure_ratio,
            efficiency: self.efficiency * other.efficiency,
            speed: self.speed * other.speed,
        }
    }
}

/// Why a map cannot be scaled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ScaleError {
    #[error("the factor on {quantity} is {factor}; give one above 0")]
    NotPositive { quantity: &'static str, factor: f64 },
    #[error(
        "a factor of {factor} on the efficiency makes {:.1} % at {speed_corrected_rpm:.0} rpm and {flow_corrected_kg_s:.4} kg/s; give at most {:.4}",
        100.0 * eta * factor,
        eta.recip()
    )]
    Efficiency { factor: f64, eta: f64, speed_corrected_rpm: f64, flow_corrected_kg_s: f64 },
}

/// A map with its quantities multiplied, measured values included. Intervals and standard errors scale with their quantity: the error of the
/// scaling itself is not in them. Heat-transfer coefficients and a fitted surface are dropped.
pub fn scaled(mut map: CompressorMap, scale: MapScale) -> Result<CompressorMap, ScaleError> {
    let MapScale { flow, pressure_ratio, efficiency, speed } = scale;
    let factors = [
        ("the flow", flow),
        ("PR - 1", pressure_ratio),
        ("the efficiency", efficiency),
        ("the speed", speed),
    ];
    if let Some((quantity, factor)) =
        factors.into_iter().find(|(_, factor)| !(factor.is_finite() && *factor > 0.0))
    {
        return Err(ScaleError::NotPositive { quantity, factor });
    }
    map.fitted = None;
    map.wheel_diameter_m = map.wheel_diameter_m.filter(|_| speed == 1.0 && flow == 1.0);
    map.scale_corrected(speed, flow);
    let ratio = |value: f64| 1.0 + pressure_ratio * (value - 1.0);
    for SpeedLine { speed_corrected_rpm, target_speed_rpm, points, .. } in &mut map.lines {
        target_speed_rpm.iter_mut().for_each(|rpm| *rpm *= speed);
        for point in points {
            if let Some(eta) = point.eta.filter(|eta| eta * efficiency >= 1.0) {
                return Err(ScaleError::Efficiency {
                    factor: efficiency,
                    eta,
                    speed_corrected_rpm: *speed_corrected_rpm,
                    flow_corrected_kg_s: point.flow_corrected_kg_s,
                });
            }
            scale_efficiency(point, efficiency);
            point.pressure_ratio = ratio(point.pressure_ratio);
            point.shift.iter_mut().for_each(|shift| shift.pressure_ratio *= pressure_ratio);
            let own = &mut point.identified;
            own.pressure_ratio = ratio(own.pressure_ratio);
            own.common.pressure_ratio_standard_error *= pressure_ratio;
            own.flow_kg_s *= flow;
            own.speed_rpm *= speed;
            own.target.iter_mut().for_each(|target| target.speed_rpm *= speed);
            own.eta_allowance = own.eta_allowance.map(|eta| eta * efficiency);
            (own.h_w_m2k, own.h_low_w_m2k, own.h_high_w_m2k, own.h_uncertainty) = (None, None, None, None);
            own.common.h_changes_w_m2k.clear();
        }
    }
    for mark in &mut map.surge {
        mark.target_speed_rpm *= speed;
        mark.pressure_ratio = ratio(mark.pressure_ratio);
        mark.pressure_ratio_standard_error *= pressure_ratio;
    }
    Ok(map)
}

/// What a speed line of a merged map is made of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MergedLine {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Number of points of the first map.
    pub of_first: usize,
    /// Number of points of the second map, moved to this speed by similarity.
    pub of_second: usize,
    /// Number of points of the second map that lie within the first one's line, and are left out.
    pub left_out: usize,
}

/// Two maps of one machine as one.
#[derive(Debug, Clone, PartialEq)]
pub struct MergedMap {
    /// The map, at the first one's reference state, without a fitted surface.
    pub map: CompressorMap,
    /// Its lines, in order of speed.
    pub lines: Vec<MergedLine>,
    /// The seam: both maps where both have been measured; `None` if they do not overlap, or are too small to be compared.
    pub seam: Option<MapComparison>,
}

/// Merges two maps of one machine. Where both have a line of one speed (within 1 %), the first one's points are kept, and those of the second
/// beyond its ends are added; all other lines of the second are added whole. The second map is converted to the first's reference state and,
/// if both state one, to its definition of efficiency.
pub fn merge(first: &CompressorMap, second: &CompressorMap) -> MergedMap {
    let seam = compare(first, second).ok().filter(|found| found.lines.iter().any(|l| !l.places.is_empty()));
    let second = second.clone().at_reference(first.reference);
    let second = match (second.efficiency, first.efficiency) {
        (Some(from), Some(to)) => convert_efficiency(second, from, to),
        _ => second,
    };
    let mut map = CompressorMap { fitted: None, ..first.clone() };
    let mut counts: Vec<[usize; 3]> = map.lines.iter().map(|line| [line.points.len(), 0, 0]).collect();
    for other in second.lines {
        let speed_rpm = other.speed_corrected_rpm;
        let distance = |line: &SpeedLine| (line.speed_corrected_rpm / speed_rpm - 1.0).abs();
        let same = (0..first.lines.len())
            .min_by(|a, b| distance(&map.lines[*a]).total_cmp(&distance(&map.lines[*b])));
        let Some(place) = same.filter(|place| distance(&map.lines[*place]) <= END_TOLERANCE_RATIO) else {
            counts.push([0, other.points.len(), 0]);
            map.lines.push(other);
            continue;
        };
        let own = &mut map.lines[place];
        let (low, high) = range(own.points.iter().map(|point| point.flow_corrected_kg_s));
        let moved =
            other.points.iter().map(|point| move_to_speed(&point.identified, own.speed_corrected_rpm));
        let (beyond, within): (Vec<_>, Vec<_>) =
            moved.partition(|point| !(low..=high).contains(&point.flow_corrected_kg_s));
        (counts[place][1], counts[place][2]) =
            (counts[place][1] + beyond.len(), counts[place][2] + within.len());
        let points = own.points.drain(..).chain(beyond).collect();
        *own = SpeedLine { target_speed_rpm: own.target_speed_rpm, ..line(own.speed_corrected_rpm, points) };
    }
    let is_new = |rpm: f64| {
        first.surge.iter().all(|own| (own.speed_corrected_rpm / rpm - 1.0).abs() > END_TOLERANCE_RATIO)
    };
    map.surge.extend(second.surge.into_iter().filter(|mark| is_new(mark.speed_corrected_rpm)));
    map.surge.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let mut both: Vec<(SpeedLine, [usize; 3])> = map.lines.drain(..).zip(counts).collect();
    both.sort_by(|(a, _), (b, _)| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let (lines, counts): (Vec<SpeedLine>, Vec<[usize; 3]>) = both.into_iter().unzip();
    let of = |(line, [of_first, of_second, left_out]): (&SpeedLine, [usize; 3])| MergedLine {
        speed_corrected_rpm: line.speed_corrected_rpm,
        of_first,
        of_second,
        left_out,
    };
    let merged = lines.iter().zip(counts).map(of).collect();
    MergedMap { map: CompressorMap { lines, ..map }, lines: merged, seam }
}
