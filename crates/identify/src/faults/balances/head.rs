//! Head over speed squared: similar points of a compressor have the same head coefficient at every speed.
//!
//! `dT_is/N^2` over the flow coefficient is one curve, with a slow change by compressibility (Dixon and Hall, Fluid Mechanics and
//! Thermodynamics of Turbomachinery, ch. 2). A declared map gives a speed for the measured flow and pressure ratio, which is compared with N.

use crate::faults::balance_rows::{Machine, Rows, common, errors, own};
use crate::faults::end_readings::{PerChannel, Readings};
use crate::faults::nominal_rig::NominalRig;
use crate::faults::places::{Places, is_on_a_map};
use crate::faults::smooth::{ANY_ROUGHNESS, At, Smooth};
use mapper_core::ReferenceState;
use nalgebra::DVector;

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

pub(crate) fn rows(
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
