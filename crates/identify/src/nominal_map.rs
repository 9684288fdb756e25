//! The efficiencies found beside the nominal map, where a campaign declares how far the machine may be off it.
//!
//! Offsets far beyond their declaration and heat that eqs. 1-3 do not know bend the efficiencies smoothly, which the points
//! alone cannot tell from a map that bends. The nominal map can, as far as it is declared to be true.

use crate::findings::code;
use mapper_core::{IdentifiedPoint, Method, ModelTolerances, ReferenceState, Verdict, Warning};
use mapper_numerics::polyline::NearestOnPolyline;
use mapper_physics::characteristic::CompressorCharacteristic;
use mapper_physics::compression::isentropic_rise_ratio;
use mapper_physics::model::Model;
use nalgebra::{DMatrix, DVector};

/// Declared standard deviations of the efficiency's scale that are allowed for: a machine may be better or worse than its
/// map all over without any of its points being wrong.
const SCALE_SIGMAS: f64 = 6.0;
/// The same of the map's smooth error, and the least that is allowed for, fraction.
const SHAPE_SIGMAS: f64 = 3.0;
const LEAST_SHAPE: f64 = 3e-3;
/// Lengths of that error: of speed in halves of the range of the points, of pressure ratio likewise.
const LENGTH: f64 = 0.7;
/// Standard deviations of chi-square above its mean beyond which the points are doubted: one in a thousand of 20 points.
const DOUBT_SIGMAS: f64 = 4.0;
/// Standard deviations of a temperature's offset.
const OFFSET_SIGMAS: f64 = 3.0;
/// Standard errors of a creep over the run: one in sixteen thousand by chance.
const CREEP_SIGMAS: f64 = 4.0;
/// Standard errors of the level beyond its tolerance.
const LEVEL_SIGMAS: f64 = 4.0;
/// How far along its speed line a point may be misplaced by the tolerances of flow map and valve, in units of the line's
/// largest flow and largest PR - 1, one standard deviation.
const PLACE_RATIO: f64 = 0.01;
/// Places of a speed line among which the nearest is sought.
const PLACES: usize = 200;
/// Fewest points that say anything of a map, and most that are looked at: the effort grows with the cube.
const FEWEST: usize = 5;
const MOST: usize = 500;

/// Standard error of what `dynamic` has of its own, fraction: h is held constant while the flow still moves, and half a point of
/// error by that passes without a doubt.
const DYNAMIC_OWN: f64 = 5e-3;

/// What a campaign declares of its rig, and how far it may be off it.
#[derive(Debug, Clone, Copy)]
pub struct NominalRig<'a> {
    /// Map, valve and geometry.
    pub model: &'a Model,
    /// One-sigma tolerances.
    pub tolerances: &'a ModelTolerances,
}

/// Doubts all points of a recording whose efficiencies lie off the nominal map by more than its declared tolerances, the
/// points' own intervals and a common scale together explain. `reference`: of the points' corrected speeds.
pub fn doubt_off_the_nominal_map(
    points: &mut [IdentifiedPoint],
    map: &dyn CompressorCharacteristic,
    reference: ReferenceState,
    tolerances: &ModelTolerances,
) {
    let Some(message) = off_the_map(points, map, reference, tolerances) else { return };
    for point in points.iter_mut().filter(|point| adiabatic(point) && point.eta.is_some()) {
        point.verdict = point.verdict.doubted();
        let warning = Warning { code: code::OFF_THE_NOMINAL_MAP.to_owned(), message: message.clone() };
        point.warnings.insert(0, warning);
    }
}

/// Whether a point's efficiency is that of a map, without heat.
fn adiabatic(point: &IdentifiedPoint) -> bool {
    matches!(point.method, Method::Joint | Method::Dynamic)
}

/// The nominal map at the place of a speed line that is nearest to a point.
#[derive(Debug, Clone, Copy)]
struct OnMap {
    /// Efficiency, fraction.
    eta: f64,
    /// Its slope along the line, per unit of the line's largest flow and largest PR - 1.
    slope: f64,
}

/// By flow near choke and by pressure ratio near surge at once: each alone says little of the place at the other end.
fn nearest(
    point: &IdentifiedPoint,
    map: &dyn CompressorCharacteristic,
    speed_corrected_rpm: f64,
    flow_factor: f64,
) -> Option<OnMap> {
    let (_, top) = map.surge_point(speed_corrected_rpm);
    let largest_kg_s = map.choke_flow_corrected_kg_s(speed_corrected_rpm);
    if !(top > 1.0 && largest_kg_s > 0.0) {
        return None;
    }
    // A little beyond the surge side: a rig may reach further than its map.
    let places: Vec<((f64, f64), f64)> = (0..=PLACES)
        .map(|k| {
            let pressure_ratio = 1.0 + (top - 1.0) * 1.03 * k as f64 / PLACES as f64;
            let place = map.evaluate(speed_corrected_rpm, pressure_ratio);
            let at = (place.flow_corrected_kg_s / largest_kg_s, (pressure_ratio - 1.0) / (top - 1.0));
            (at, place.efficiency)
        })
        .collect();
    let line: Vec<(f64, f64)> = places.iter().map(|(at, _)| *at).collect();
    let here =
        (point.flow_corrected_kg_s * flow_factor / largest_kg_s, (point.pressure_ratio - 1.0) / (top - 1.0));
    let NearestOnPolyline { segment, share_ratio, .. } = NearestOnPolyline::of(&line, here)?;
    let (((ax, ay), a), ((bx, by), b)) = (places[segment], places[segment + 1]);
    Some(OnMap { eta: a + share_ratio * (b - a), slope: (b - a) / (bx - ax).hypot(by - ay).max(1e-9) })
}

/// What speaks against the points, in a sentence; `None` where all is explained.
pub(crate) fn off_the_map(
    points: &[IdentifiedPoint],
    map: &dyn CompressorCharacteristic,
    reference: ReferenceState,
    tolerances: &ModelTolerances,
) -> Option<String> {
    let speed_factor = reference.speed_factor_to(map.reference());
    let flow_factor = reference.flow_factor_to(map.reference());
    // Share of the run at which each was measured, from -0.5 to 0.5.
    let when = |place: usize| place as f64 / (points.len().max(2) - 1) as f64 - 0.5;
    let used: Vec<(&IdentifiedPoint, OnMap, f64, f64)> = points
        .iter()
        .enumerate()
        .filter(|(_, point)| adiabatic(point) && point.verdict == Verdict::Good)
        .filter_map(|(place, point)| {
            let nominal = nearest(point, map, point.speed_corrected_rpm * speed_factor, flow_factor)?;
            let off = point.eta? - nominal.eta;
            (off.is_finite() && point.eta_own_standard_error().is_some()).then_some((
                point,
                nominal,
                off,
                when(place),
            ))
        })
        .take(MOST)
        .collect();
    let count = used.len();
    if count < FEWEST {
        return None;
    }
    let scaled = |of: fn(&IdentifiedPoint) -> f64| -> Vec<f64> {
        let values: Vec<f64> = used.iter().map(|(point, ..)| of(point)).collect();
        let (low, high) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        values.iter().map(|x| 2.0 * (x - low) / (high - low).max(f64::MIN_POSITIVE)).collect()
    };
    let (u, v) = (scaled(|point| point.speed_corrected_rpm), scaled(|point| point.pressure_ratio));
    let shape = (SHAPE_SIGMAS * tolerances.efficiency_shape_ratio).max(LEAST_SHAPE);
    let scale = SCALE_SIGMAS * tolerances.compressor_efficiency_ratio;
    let covariance = DMatrix::from_fn(count, count, |i, j| {
        let ((one, nominal, ..), (other, other_nominal, ..)) = (used[i], used[j]);
        let own = if i == j {
            let own = one.eta_own_standard_error().unwrap_or(0.0);
            let constant_h = if one.method == Method::Dynamic { DYNAMIC_OWN } else { 0.0 };
            own * own + constant_h * constant_h + (PLACE_RATIO * nominal.slope).powi(2) + 1e-6
        } else {
            0.0
        };
        let square = ((u[i] - u[j]).powi(2) + (v[i] - v[j]).powi(2)) / (LENGTH * LENGTH);
        one.common.eta_covariance(&other.common)
            + own
            + shape * shape * nominal.eta * other_nominal.eta * (-0.5 * square).exp()
    });
    let off = DVector::from_iterator(count, used.iter().map(|(.., off, _)| *off));
    let etas = DVector::from_iterator(count, used.iter().map(|(_, nominal, ..)| nominal.eta));
    // The level by itself: a machine may be better or worse all over, but not by any amount.
    let factor = covariance.clone().cholesky()?;
    let (information, pull) = (etas.dot(&factor.solve(&etas)), etas.dot(&factor.solve(&off)));
    let level = pull / information;
    if level.abs() > scale + LEVEL_SIGMAS * information.sqrt().recip() {
        return Some(format!(
            "the efficiencies lie {:+.1} % off the nominal map all over, and {:.1} % are its declared tolerance: T1, T2, P1 or P2 is \
             scaled or off, or the machine is another; `mapper gap diagnose` tells which",
            100.0 * level,
            100.0 * tolerances.compressor_efficiency_ratio,
        ));
    }
    let covariance = covariance + scale * scale * &etas * etas.transpose();
    // One offset of a temperature by itself: among all that chi-square allows for it would hide.
    let slopes = DVector::from_iterator(
        count,
        used.iter().map(|(point, nominal, ..)| {
            -nominal.eta * nominal.eta
                / (point.t1_k * isentropic_rise_ratio(point.pressure_ratio, point.t1_k))
        }),
    );
    let common = DMatrix::from_fn(count, count, |i, j| used[i].0.common.eta_covariance(&used[j].0.common));
    let beside = (&covariance - common).cholesky()?;
    let weights = beside.solve(&slopes) / slopes.dot(&beside.solve(&slopes));
    let (offset_k, sigma_k) = (weights.dot(&off), weights.dot(&(&covariance * &weights)).max(0.0).sqrt());
    if offset_k.abs() > OFFSET_SIGMAS * sigma_k {
        return Some(format!(
            "the efficiencies lie off the nominal map as if T2 - T1 read {offset_k:+.1} K too much, and {sigma_k:.1} K are what sensors and \
             map are declared to explain (one standard deviation): T1, T2, Tc or the pressures are off; compare them at standstill (`zero`)"
        ));
    }
    let factor = covariance.cholesky()?;
    // One that comes over the run: no map changes with the time, so that only chance and what else changed with it hide a creep.
    let creep =
        DVector::from_iterator(count, used.iter().zip(slopes.iter()).map(|((.., when), slope)| slope * when));
    let solved = factor.solve(&creep);
    let (pull, information) = (solved.dot(&off), solved.dot(&creep));
    if pull.abs() > CREEP_SIGMAS * information.sqrt() {
        return Some(format!(
            "beside the nominal map the efficiencies change over the run as if T2 - T1 crept by {:+.1} +/- {:.1} K, whatever speed and \
             flow: T1, T2, Tc or a pressure creeps; compare them at standstill before and after (`zero`)",
            pull / information,
            2.0 / information.sqrt(),
        ));
    }
    let chi_square = off.dot(&factor.solve(&off));
    let freedom = count as f64;
    if chi_square <= freedom + DOUBT_SIGMAS * (2.0 * freedom).sqrt() {
        return None;
    }
    Some(format!(
        "the efficiencies lie {:+.1} to {:+.1} points off the nominal map, more than its declared tolerances and these intervals \
         explain (chi-square {chi_square:.0} of {count} points): a sensor is off beyond its declaration, heat goes a way the model \
         lacks, or the machine is another; `mapper gap diagnose` tells which",
        100.0 * off.min(),
        100.0 * off.max(),
    ))
}
