//! The efficiencies found beside the nominal map, where a campaign declares how far the machine may be off it.
//!
//! Offsets far beyond their declaration and heat that eqs. 1-3 do not know bend the efficiencies smoothly, which the points
//! alone cannot tell from a map that bends. The nominal map can, as far as it is declared to be true.

use crate::findings::code;
use crate::{StepError, Thresholds};
use mapper_core::{
    IdentifiedPoint, Method, ModelTolerances, ReferenceState, Verdict, Warning, confidence_interval_95,
    standard_error_of,
};
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
/// The same from which on intervals reach to it: one sound recording in twenty-two.
const LIKELY_SIGMAS: f64 = 2.0;
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
    doubt(points.iter_mut().filter(|point| adiabatic(point) && point.eta.is_some()), &message);
}

/// Doubts these points for what the nominal map says.
pub(crate) fn doubt<'a>(points: impl Iterator<Item = &'a mut IdentifiedPoint>, message: &str) {
    for point in points {
        point.verdict = point.verdict.doubted();
        let code = code::OFF_THE_NOMINAL_MAP.to_owned();
        point.warnings.insert(0, Warning { code, message: message.to_owned() });
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
    let beside = Beside::of(points, map, reference, tolerances, |point| point.verdict == Verdict::Good)?;
    beside
        .level()
        .or_else(|| beside.offset()?.objection())
        .or_else(|| beside.creep())
        .or_else(|| beside.all())
}

/// How much T2 - T1 seems to read too much, by the efficiencies beside the nominal map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Offset {
    /// Found, K.
    pub(crate) found_k: f64,
    /// What sensors and map are declared to explain, one standard deviation, K.
    pub(crate) sigma_k: f64,
}

impl Offset {
    pub(crate) fn sigmas(&self) -> f64 {
        self.found_k / self.sigma_k
    }

    /// Too likely to be kept out of the intervals.
    pub(crate) fn is_likely(&self) -> bool {
        self.sigmas().abs() > LIKELY_SIGMAS
    }

    pub(crate) fn objection(&self) -> Option<String> {
        (self.sigmas().abs() > OFFSET_SIGMAS).then(|| {
            format!(
                "the efficiencies lie off the nominal map as if T2 - T1 read {:+.1} K too much, and {:.1} K are what sensors and \
                 map are declared to explain (one standard deviation): T1, T2, Tc or the pressures are off; compare them at standstill (`zero`)",
                self.found_k, self.sigma_k
            )
        })
    }
}

/// Lets the interval of every efficiency reach to what the map says of an offset that is likely, and not so likely that the points are refused.
pub(crate) fn reach(
    points: &mut [Result<IdentifiedPoint, StepError>],
    offset: Offset,
    thresholds: &Thresholds,
) {
    let message = format!(
        "beside the nominal map T2 - T1 seems to read {:+.1} K too much, {:.1} standard deviations of what sensors and map are declared to \
         explain: the interval of eta reaches that far; compare T1, T2 and Tc at standstill (`zero`)",
        offset.found_k,
        offset.sigmas().abs()
    );
    let errors = points.iter().flatten().map(|point| point.common.eta_changes.len()).max().unwrap_or(0);
    for point in points.iter_mut().flatten() {
        let (Some(eta), Some(low), Some(high)) = (point.eta, point.eta_low, point.eta_high) else { continue };
        let rise_k = point.t1_k * isentropic_rise_ratio(point.pressure_ratio, point.t1_k);
        // As much as half of a 95 % interval.
        let reached = -eta * eta / rise_k * offset.found_k;
        let change = standard_error_of(-reached, reached);
        let error = change.hypot(standard_error_of(low, high));
        if !error.is_finite() {
            continue;
        }
        let (low, high) = confidence_interval_95(eta, error);
        (point.eta_low, point.eta_high) = (Some(low), Some(high));
        if let Some(uncertainty) = &mut point.eta_uncertainty {
            uncertainty.bias_standard_error = uncertainty.bias_standard_error.hypot(change);
        }
        point.common.eta_changes.resize(errors, 0.0);
        point.common.eta_changes.push(change);
        if point.verdict == Verdict::Good && error > thresholds.sigma_eta {
            point.verdict = Verdict::Doubtful;
        }
        point
            .warnings
            .insert(0, Warning { code: code::OFF_THE_NOMINAL_MAP.to_owned(), message: message.clone() });
    }
}

/// The offset by the points that are good, or not good merely for what an offset does to them: an efficiency at low speed is uncertain
/// because of offsets, and tells most of them.
pub(crate) fn offset(
    points: &[IdentifiedPoint],
    map: &dyn CompressorCharacteristic,
    reference: ReferenceState,
    tolerances: &ModelTolerances,
) -> Option<Offset> {
    let tells = |point: &IdentifiedPoint| point.verdict == Verdict::Good || merely_wide(point);
    Beside::of(points, map, reference, tolerances, tells)?.offset()
}

/// Whether nothing but the width of its interval speaks against a point.
fn merely_wide(point: &IdentifiedPoint) -> bool {
    const WIDE: [&str; 3] = [code::SMALL_GRADIENT, code::OFFSETS_DOMINATE, code::NOISE_DOMINATES];
    const REMARKS: [&str; 3] = [code::OUTLIERS, code::THROUGH_THE_LAW, code::SPEED_NOT_REACHED];
    point.verdict == Verdict::Doubtful
        && point
            .warnings
            .iter()
            .all(|warning| WIDE.contains(&warning.code.as_str()) || REMARKS.contains(&warning.code.as_str()))
}

/// A point beside the map.
struct Pair<'a> {
    point: &'a IdentifiedPoint,
    nominal: OnMap,
    /// Efficiency, and its standard error that no other point shares, fraction.
    eta: f64,
    own: f64,
    /// Temperature rise of isentropic compression, K.
    rise_k: f64,
    /// Share of the run at which it was measured, from -0.5 to 0.5.
    when: f64,
}

/// Points beside the map, with what is declared to be between them.
struct Beside<'a> {
    pairs: Vec<Pair<'a>>,
    /// How alike the map's errors at two points are, 0 to 1.
    alike: DMatrix<f64>,
    /// What is allowed for of the map's smooth error and of its level, fractions of the efficiency.
    shape: f64,
    scale: f64,
    /// Tolerance of the level, one standard deviation, fraction.
    level_tolerance: f64,
}

/// A quantity of each point that goes with its efficiency: by how much it changes with the efficiency found, and with that of the map.
struct Scale {
    found: Vec<f64>,
    nominal: Vec<f64>,
}

impl<'a> Beside<'a> {
    /// Those of `points` that tell; `None` where they are too few to say anything of a map.
    fn of(
        points: &'a [IdentifiedPoint],
        map: &dyn CompressorCharacteristic,
        reference: ReferenceState,
        tolerances: &ModelTolerances,
        tells: impl Fn(&IdentifiedPoint) -> bool,
    ) -> Option<Self> {
        let speed_factor = reference.speed_factor_to(map.reference());
        let flow_factor = reference.flow_factor_to(map.reference());
        let when = |place: usize| place as f64 / (points.len().max(2) - 1) as f64 - 0.5;
        let pairs: Vec<Pair<'a>> = points
            .iter()
            .enumerate()
            .filter(|(_, point)| adiabatic(point) && tells(point))
            .filter_map(|(place, point)| {
                let nominal = nearest(point, map, point.speed_corrected_rpm * speed_factor, flow_factor)?;
                let (eta, own) = (point.eta?, point.eta_own_standard_error()?);
                let rise_k = point.t1_k * isentropic_rise_ratio(point.pressure_ratio, point.t1_k);
                let known = (eta - nominal.eta).is_finite();
                known.then_some(Pair { point, nominal, eta, own, rise_k, when: when(place) })
            })
            .take(MOST)
            .collect();
        let count = pairs.len();
        if count < FEWEST {
            return None;
        }
        let scaled = |of: fn(&IdentifiedPoint) -> f64| -> Vec<f64> {
            let values: Vec<f64> = pairs.iter().map(|pair| of(pair.point)).collect();
            let (low, high) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
            values.iter().map(|x| 2.0 * (x - low) / (high - low).max(f64::MIN_POSITIVE)).collect()
        };
        let (u, v) = (scaled(|point| point.speed_corrected_rpm), scaled(|point| point.pressure_ratio));
        let alike = DMatrix::from_fn(count, count, |i, j| {
            let square = ((u[i] - u[j]).powi(2) + (v[i] - v[j]).powi(2)) / (LENGTH * LENGTH);
            (-0.5 * square).exp()
        });
        Some(Beside {
            pairs,
            alike,
            shape: (SHAPE_SIGMAS * tolerances.efficiency_shape_ratio).max(LEAST_SHAPE),
            scale: SCALE_SIGMAS * tolerances.compressor_efficiency_ratio,
            level_tolerance: tolerances.compressor_efficiency_ratio,
        })
    }

    fn column(&self, of: impl Fn(&Pair<'_>) -> f64) -> DVector<f64> {
        DVector::from_iterator(self.pairs.len(), self.pairs.iter().map(of))
    }

    /// By how much the efficiencies lie off the map, fraction.
    fn off(&self) -> DVector<f64> {
        self.column(|pair| pair.eta - pair.nominal.eta)
    }

    /// Efficiencies of the map, fraction.
    fn etas(&self) -> DVector<f64> {
        self.column(|pair| pair.nominal.eta)
    }

    /// The efficiency itself.
    fn as_it_is(&self) -> Scale {
        Scale { found: vec![1.0; self.pairs.len()], nominal: vec![1.0; self.pairs.len()] }
    }

    /// Covariance by what the points share of sensors and method.
    fn common(&self, by: &Scale) -> DMatrix<f64> {
        DMatrix::from_fn(self.pairs.len(), self.pairs.len(), |i, j| {
            let (one, other) = (&self.pairs[i].point.common, &self.pairs[j].point.common);
            by.found[i] * by.found[j] * one.eta_covariance(other)
        })
    }

    /// Covariance by each point's own error and by the map's shape.
    fn beside(&self, by: &Scale) -> DMatrix<f64> {
        DMatrix::from_fn(self.pairs.len(), self.pairs.len(), |i, j| {
            let (one, other) = (&self.pairs[i], &self.pairs[j]);
            let own = if i == j {
                let constant_h = if one.point.method == Method::Dynamic { DYNAMIC_OWN } else { 0.0 };
                by.found[i].powi(2) * (one.own * one.own + constant_h * constant_h + 1e-6)
                    + (by.nominal[i] * PLACE_RATIO * one.nominal.slope).powi(2)
            } else {
                0.0
            };
            let maps = by.nominal[i] * one.nominal.eta * by.nominal[j] * other.nominal.eta;
            own + self.shape * self.shape * maps * self.alike[(i, j)]
        })
    }

    /// Covariance of the efficiencies, at a level of their own or at the map's.
    fn covariance(&self, scale: f64) -> DMatrix<f64> {
        let (by, etas) = (self.as_it_is(), self.etas());
        self.common(&by) + self.beside(&by) + scale * scale * &etas * etas.transpose()
    }

    /// The level by itself: a machine may be better or worse all over, but not by any amount.
    fn level(&self) -> Option<String> {
        let etas = self.etas();
        let solved = self.covariance(0.0).cholesky()?.solve(&etas);
        let (information, pull) = (solved.dot(&etas), solved.dot(&self.off()));
        let level = pull / information;
        (level.abs() > self.scale + LEVEL_SIGMAS * information.sqrt().recip()).then(|| {
            format!(
                "the efficiencies lie {:+.1} % off the nominal map all over, and {:.1} % are its declared tolerance: T1, T2, P1 or P2 is \
                 scaled or off, or the machine is another; `mapper gap diagnose` tells which",
                100.0 * level,
                100.0 * self.level_tolerance,
            )
        })
    }

    /// One offset of a temperature by itself: among all that chi-square allows for it would hide. Sought in the temperature rise, isentropic
    /// rise over efficiency, to which an offset adds at all efficiencies: of the efficiency it takes the more the higher that is found.
    fn offset(&self) -> Option<Offset> {
        let off_k = self.column(|pair| pair.rise_k / pair.eta - pair.rise_k / pair.nominal.eta);
        let by = Scale {
            found: self.pairs.iter().map(|pair| pair.rise_k / (pair.eta * pair.eta)).collect(),
            nominal: self
                .pairs
                .iter()
                .map(|pair| pair.rise_k / (pair.nominal.eta * pair.nominal.eta))
                .collect(),
        };
        let level = self.column(|pair| self.scale * pair.rise_k / pair.nominal.eta);
        let beside = self.beside(&by) + &level * level.transpose();
        let solved = beside.clone().cholesky()?.solve(&self.column(|_| 1.0));
        let weights = &solved / solved.sum();
        let (found_k, sigma_k) =
            (weights.dot(&off_k), weights.dot(&((beside + self.common(&by)) * &weights)).max(0.0).sqrt());
        (found_k.is_finite() && sigma_k > 0.0).then_some(Offset { found_k, sigma_k })
    }

    /// One that comes over the run: no map changes with the time, so that only chance and what else changed with it hide a creep.
    fn creep(&self) -> Option<String> {
        let creep = self.column(|pair| -pair.nominal.eta * pair.nominal.eta / pair.rise_k * pair.when);
        let solved = self.covariance(self.scale).cholesky()?.solve(&creep);
        let (pull, information) = (solved.dot(&self.off()), solved.dot(&creep));
        (pull.abs() > CREEP_SIGMAS * information.sqrt()).then(|| {
            format!(
                "beside the nominal map the efficiencies change over the run as if T2 - T1 crept by {:+.1} +/- {:.1} K, whatever speed and \
                 flow: T1, T2, Tc or a pressure creeps; compare them at standstill before and after (`zero`)",
                pull / information,
                2.0 / information.sqrt(),
            )
        })
    }

    /// All of it together.
    fn all(&self) -> Option<String> {
        let off = self.off();
        let factor = self.covariance(self.scale).cholesky()?;
        let (chi_square, count) = (off.dot(&factor.solve(&off)), self.pairs.len());
        let freedom = count as f64;
        (chi_square > freedom + DOUBT_SIGMAS * (2.0 * freedom).sqrt()).then(|| {
            format!(
                "the efficiencies lie {:+.1} to {:+.1} points off the nominal map, more than its declared tolerances and these intervals \
                 explain (chi-square {chi_square:.0} of {count} points): a sensor is off beyond its declaration, heat goes a way the model \
                 lacks, or the machine is another; `mapper gap diagnose` tells which",
                100.0 * off.min(),
                100.0 * off.max(),
            )
        })
    }
}
