//! Balances of the compressor: efficiency and head.
//!
//! An error of a temperature adds to the work, so large errors are nearly as linear as small ones. A scale of all efficiencies is a constant.
//! The effect of a constant error is proportional to one over the rise, so it bends the map. The effect of an error that grows over the run
//! does not depend on the map position.

use crate::faults::balance_rows::{Rows, common, errors, own};
use crate::faults::end_readings::{ANY_ROUGHNESS, At, CHANNELS, PerChannel, Readings, Smooth};
use crate::faults::found_fault::Machine;
use crate::faults::nominal_rig::{NominalRig, Places, is_on_a_map};
use crate::single_step::fit::ETA_BOUNDS;
use mapper_core::{Channel, FaultKind, ReferenceState};
use mapper_physics::laws::compression::{actual_rise_k, compressed_k, isentropic_rise_ratio};
use nalgebra::{DMatrix, DVector};

/// Efficiencies and heat-transfer coefficients as fitted, before the smoothness prior.
#[derive(Debug, Clone, Default)]
pub(crate) struct FittedEfficiencies {
    pub(crate) positions: Vec<usize>,
    /// Fractions.
    pub(crate) eta: FittedQuantity,
    /// ln of h, W/(m2 K).
    pub(crate) ln_h: FittedQuantity,
    /// Whether the gas touches a wall of one temperature.
    pub(crate) has_one_wall: bool,
}

/// One quantity of all steps.
#[derive(Debug, Clone, Default)]
pub(crate) struct FittedQuantity {
    pub(crate) values: Vec<f64>,
    /// Their covariance, without the declared errors of the sensors.
    pub(crate) covariance: DMatrix<f64>,
    /// Sensitivity of each one to a constant error of each channel in all steps, per unit of the channel; `None` if no error of the channel is
    /// declared, because the fit then does not compute it.
    pub(crate) by_reading: Vec<[Option<f64>; CHANNELS.len()]>,
}

impl FittedEfficiencies {
    /// The rows of steps with readings. `readings`: of all steps, by position.
    pub(crate) fn known(&self, readings: &[Option<Readings>]) -> Vec<(usize, Readings)> {
        let rows = self.positions.iter().enumerate();
        rows.filter_map(|(row, position)| Some((row, (*readings.get(*position)?)?))).collect()
    }
}

/// `-ln eta` of any compressor: it changes by 0.4 over a speed line and by some 0.1 over the speeds. Calibrated: by hand, so that the
/// chi-square of a public measured map is its number of points ([`ANY_ROUGHNESS`]).
const ANY_MAP: Smooth = Smooth {
    terms: &[
        (0, 0, 1.0),
        (1, 0, 0.06),
        (0, 1, 0.3),
        (2, 0, 0.05),
        (1, 1, 0.15),
        (0, 2, 0.3),
        (1, 2, 0.15),
        (2, 1, 0.07),
        (3, 0, 0.03),
        (0, 3, 0.15),
        (2, 2, 0.07),
    ],
    slow: 0.015,
    amplitude: 0.03,
    lengths: (0.7, 0.5),
};
/// Shape of a declared map's error, in units of its tolerance. Bound: errors of a map extend over a third of it: shorter ones are
/// roughness.
const DECLARED_MAP: Smooth = Smooth { terms: &[], slow: 0.0, amplitude: 1.0, lengths: (0.7, 0.7) };
/// Relative error of the heat between gas and housing in eqs. 1-3, one standard deviation. Judgement: the fitted convection law contains most
/// of the heat.
const HEAT_RATIO: f64 = 0.05;
/// Position error of a point along its speed line due to the tolerances of flow map and valve, one standard deviation. Unit: the line's
/// largest flow and largest PR - 1. Bound: the product of flow tolerance and slope of a usual speed line.
const PLACE_RATIO: f64 = 0.01;

/// `readings`: of all steps, by position.
pub(crate) fn rows(
    fitted: &FittedEfficiencies,
    readings: &[Option<Readings>],
    reference: ReferenceState,
    nominal: Option<&NominalRig<'_>>,
) -> Option<Rows> {
    // Includes the slope along the speed line.
    let expected = |readings: &Readings| match nominal {
        Some(nominal) => nominal.efficiency(readings).map(|(eta, slope)| (-eta.ln(), slope / eta)),
        None => Some((0.0, 0.0)),
    };
    let known: Vec<(usize, Readings, (f64, f64))> = fitted
        .known(readings)
        .into_iter()
        .filter(|(row, readings)| {
            is_on_a_map(readings) && (ETA_BOUNDS.0..=ETA_BOUNDS.1).contains(&fitted.eta.values[*row])
        })
        .filter_map(|(row, readings)| Some((row, readings, expected(&readings)?)))
        .filter(|(_, _, (ln_work, _))| ln_work.is_finite())
        .collect();
    let count = known.len();
    let readings: Vec<Readings> = known.iter().map(|(_, readings, _)| *readings).collect();
    let places = Places::of(&readings, reference)?;
    let at: Vec<At> = readings.iter().map(|readings| places.at(readings)).collect();
    let residual: Vec<f64> =
        known.iter().map(|(row, _, (ln_work, _))| -fitted.eta.values[*row].ln() - ln_work).collect();
    let by_eta: Vec<f64> = known.iter().map(|(row, _, _)| -fitted.eta.values[*row].recip()).collect();
    let measured = DMatrix::from_fn(count, count, |i, j| {
        by_eta[i] * by_eta[j] * fitted.eta.covariance[(known[i].0, known[j].0)]
    });
    let heat: Vec<f64> =
        known.iter().map(|(row, readings, _)| heat(readings, fitted.eta.values[*row])).collect();
    let measured = measured + common(&heat, HEAT_RATIO);
    let (covariance, by_machine, by_place): (_, _, Vec<PerChannel>) = match nominal {
        Some(nominal) => {
            let tolerances = nominal.tolerances;
            let all = vec![1.0; count];
            let shape = tolerances.efficiency_shape_ratio.powi(2) * DECLARED_MAP.covariance(&at);
            let misplaced = known.iter().map(|(_, _, (_, slope))| (PLACE_RATIO * slope).hypot(ROUGHNESS));
            let covariance = measured
                + own(misplaced.collect::<Vec<_>>().into_iter())
                + common(&all, tolerances.compressor_efficiency_ratio)
                + shape;
            let map = |readings: &Readings| expected(readings).map_or(f64::NAN, |(ln_work, _)| ln_work);
            let by_place = readings.iter().map(|readings| readings.derivatives(map)).collect();
            (covariance, vec![(Machine::Efficiency, vec![-1.0; count])], by_place)
        }
        None => {
            let covariance = measured + own(vec![ANY_ROUGHNESS; count].into_iter()) + ANY_MAP.covariance(&at);
            let weights = covariance.clone().cholesky()?.solve(&DVector::from_column_slice(&residual));
            let map = |readings: &Readings| ANY_MAP.value(&places.at(readings), &at, &weights);
            let by_place = readings.iter().map(|readings| readings.derivatives(map)).collect();
            (covariance, Vec::new(), by_place)
        }
    };
    let by_reading = (0..count).map(|i| {
        let (row, readings, _) = &known[i];
        let (by_fit, apparent) = (fitted.eta.by_reading[*row], readings.derivatives(apparent));
        std::array::from_fn(|channel| {
            by_eta[i] * by_fit[channel].unwrap_or(apparent[channel]) - by_place[i][channel]
        })
    });
    let by_reading = by_reading.collect();
    let readings = known
        .iter()
        .map(|(row, readings, _)| at_gain_temperature(readings, fitted.eta.values[*row]))
        .collect();
    // It changes the slope of T2 over Tc, which convection absorbs, and nothing at equal temperatures.
    let by_fault = vec![(Channel::T2, FaultKind::TowardsWall, vec![0.0; count])];
    Some(Rows { residual, covariance, readings, by_reading, by_machine, by_fault })
}

/// The efficiencies themselves, with the effects of errors on them.
pub(crate) fn measured(fitted: &FittedEfficiencies, readings: &[Option<Readings>]) -> Rows {
    let known = fitted.known(readings);
    let by_reading = |(row, readings): &(usize, Readings)| {
        let apparent = readings.derivatives(apparent);
        std::array::from_fn(|channel| fitted.eta.by_reading[*row][channel].unwrap_or(apparent[channel]))
    };
    let count = known.len();
    Rows {
        residual: known.iter().map(|(row, _)| fitted.eta.values[*row]).collect(),
        covariance: DMatrix::zeros(count, count),
        by_reading: known.iter().map(by_reading).collect(),
        readings: known
            .iter()
            .map(|(row, readings)| at_gain_temperature(readings, fitted.eta.values[*row]))
            .collect(),
        by_machine: Vec::new(),
        by_fault: vec![(Channel::T2, FaultKind::TowardsWall, vec![0.0; count])],
    }
}

/// Efficiency of a compressor without heat transfer.
fn apparent(readings: &Readings) -> f64 {
    isentropic_rise_k(readings) / actual_rise_k(readings.t1_k(), readings.t2_k(), readings.air)
}

fn isentropic_rise_k(readings: &Readings) -> f64 {
    readings.t1_k()
        * isentropic_rise_ratio(readings.p2_pa() / readings.p1_pa(), readings.t1_k(), readings.air)
}

/// Temperature after compression without heat transfer, K.
pub(crate) fn compressed(readings: &Readings, eta: f64) -> f64 {
    let rise = isentropic_rise_ratio(readings.p2_pa() / readings.p1_pa(), readings.t1_k(), readings.air);
    compressed_k(readings.t1_k(), rise, eta, readings.air)
}

/// Temperature loss of the gas to the housing, relative to its rise by compression.
fn heat(readings: &Readings, eta: f64) -> f64 {
    let t2_prime_k = compressed(readings, eta);
    (t2_prime_k - readings.t2_k()) / (t2_prime_k - readings.t1_k())
}

/// Readings with the temperature at which a gain of T2 or Tc applies. Such a gain also changes the slope of T2 over Tc, which convection
/// absorbs. The remaining effect is the error at equal temperatures, at the temperature after compression without heat.
fn at_gain_temperature(readings: &Readings, eta: f64) -> Readings {
    let mut other = *readings;
    [other.values[1], other.values[2]] = [compressed(readings, eta); 2];
    other
}

// Head over speed squared: similar points of a compressor have the same head coefficient at every speed.
// `dT_is/N^2` over the flow coefficient is one curve, with a slow change by compressibility (Dixon and Hall, Fluid Mechanics and
// Thermodynamics of Turbomachinery, ch. 2). A declared map gives a speed for the measured flow and pressure ratio, which is compared with N.

/// The curve of any compressor: ln of its distance from the origin over speed and angle. Calibrated: by hand, so that the chi-square of a
/// public measured map is its number of points ([`ANY_ROUGHNESS`]).
const ANY_CURVE: Smooth = Smooth {
    terms: &[
        (0, 0, 3.0),
        (1, 0, 0.3),
        (0, 1, 0.3),
        (2, 0, 0.1),
        (1, 1, 0.2),
        (0, 2, 0.2),
        (1, 2, 0.1),
        (2, 1, 0.1),
        (3, 0, 0.05),
        (0, 3, 0.1),
        (2, 2, 0.05),
        (1, 3, 0.05),
        (0, 4, 0.05),
    ],
    slow: 0.0,
    amplitude: 0.02,
    lengths: (0.7, 0.5),
};
/// Smooth error of a declared map, in units of its declared tolerance of flow: the remaining error is a common factor. Bound: errors of a
/// map extend over a third of it: shorter ones are roughness.
const DECLARED_HEAD: Smooth = Smooth { terms: &[], slow: 0.0, amplitude: 1.0, lengths: (0.7, 0.7) };
/// Deviation of the rig from a declared map, ratio: readings at the end of a step that is not fully settled. Bound: half the usual
/// tolerance of a map, 0.5 %.
pub(crate) const ROUGHNESS: f64 = 2e-3;

pub(crate) fn head_rows(
    readings: &[Readings],
    noise: &PerChannel,
    reference: ReferenceState,
    nominal: Option<&NominalRig<'_>>,
) -> Option<Rows> {
    match nominal {
        Some(nominal) => declared(readings, noise, reference, nominal),
        None => any(readings, noise, reference),
    }
}

fn declared(
    readings: &[Readings],
    noise: &PerChannel,
    reference: ReferenceState,
    nominal: &NominalRig<'_>,
) -> Option<Rows> {
    let ln_speed = |readings: &Readings| {
        nominal.speed_rpm(readings).map_or(f64::NAN, |speed_rpm| (readings.speed_rpm() / speed_rpm).ln())
    };
    let readings: Vec<Readings> =
        readings.iter().filter(|one| is_on_a_map(one) && ln_speed(one).is_finite()).copied().collect();
    let places = Places::of(&readings, reference)?;
    let at: Vec<At> = readings.iter().map(|readings| places.at(readings)).collect();
    let by_reading: Vec<PerChannel> =
        readings.iter().map(|readings| readings.derivatives(ln_speed)).collect();
    // A map with more flow reaches the measured flow at a lower speed.
    let by_flow: Vec<f64> =
        readings.iter().zip(&by_reading).map(|(readings, by)| by[5] * readings.flow_kg_s()).collect();
    let sigma = nominal.tolerances.flow_map_ratio;
    let shape = DECLARED_HEAD.covariance(&at);
    let shape = shape.map_with_location(|i, j, alike| alike * sigma * sigma * by_flow[i] * by_flow[j]);
    let covariance = own(errors(&by_reading, noise, ROUGHNESS).into_iter()) + common(&by_flow, sigma) + shape;
    Some(Rows {
        residual: readings.iter().map(ln_speed).collect(),
        covariance,
        readings,
        by_reading,
        by_machine: vec![(Machine::FlowCapacity, by_flow)],
        by_fault: Vec::new(),
    })
}

/// Residuals of head and flow coefficient from smooth curves. A wrong reading also moves the position on the curve.
fn any(readings: &[Readings], noise: &PerChannel, reference: ReferenceState) -> Option<Rows> {
    let readings: Vec<Readings> = readings.iter().filter(|readings| is_on_a_map(readings)).copied().collect();
    let places = Places::of(&readings, reference)?;
    let at: Vec<At> = readings.iter().map(|readings| places.at(readings)).collect();
    let prior = ANY_CURVE.covariance(&at);
    let residual: Vec<f64> = readings.iter().map(|readings| places.ln_distance(readings)).collect();
    let by_reading = |expected: &dyn Fn(&Readings) -> f64| -> Vec<PerChannel> {
        let off = |readings: &Readings| places.ln_distance(readings) - expected(readings);
        readings.iter().map(|readings| readings.derivatives(off)).collect()
    };
    let direct = errors(&by_reading(&|_| 0.0), noise, ANY_ROUGHNESS);
    let weights =
        (own(direct.into_iter()) + &prior).cholesky()?.solve(&DVector::from_column_slice(&residual));
    let by_reading = by_reading(&|readings| ANY_CURVE.value(&places.at(readings), &at, &weights));
    let covariance = own(errors(&by_reading, noise, ANY_ROUGHNESS).into_iter()) + prior;
    Some(Rows { residual, covariance, readings, by_reading, by_machine: Vec::new(), by_fault: Vec::new() })
}
