//! Flow through the back-pressure valve: one opening has one area.
//!
//! `m sqrt(T2)/(P2 psi(P1/P2))`, with the St. Venant and Wantzel function psi of an orifice that discharges to the inlet pressure, is the area
//! of the valve. Without a declared valve the area is unknown, and need not be proportional to the opening.

use crate::faults::balance_rows::{Machine, Rows, common, errors, own};
use crate::faults::end_readings::{PerChannel, Readings};
use crate::faults::nominal_rig::NominalRig;
use mapper_core::StepMarker;
use mapper_numerics::statistics::EXCLUDE_SIGMAS;
use mapper_observe::model_inputs::lagged_command::SAFE_OPENING;
use mapper_observe::perturbation::UNINFORMATIVE;
use mapper_physics::laws::orifice;
use nalgebra::DMatrix;

/// Difference of two openings that are the same command. Bound: the rounding of a logged command in per cent.
const SAME_OPENING: f64 = 1e-6;

/// Difference between the pressure behind the valve, which is not measured, and the inlet pressure, one standard deviation, Pa. Bound:
/// filters, silencers and exhaust lines have some hundred.
const BACK_PRESSURE_SIGMA_PA: f64 = 300.0;
/// Variation of a valve's discharge coefficient with the pressure ratio, one standard deviation. Judgement: usual valves vary by some per cent.
const DISCHARGE_RATIO: f64 = 0.02;
/// Difference of the logarithm of the pressure ratio over which it varies. Judgement: half a speed line.
const DISCHARGE_LENGTH: f64 = 0.5;
/// Repeatability of a valve's area, one standard deviation. Bound: a positioner resolves some tenths of a per cent of the travel.
const VALVE_REPEATABILITY: f64 = 0.005;

/// Where a valve stands in a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Opening {
    /// Its opening, with the declared play.
    pub(crate) position: f64,
    /// 1 if it came by opening, -1 if by closing: play leaves it behind.
    pub(crate) side: f64,
}

/// From which side the valve came to each step: 1 by opening, -1 by closing.
pub(crate) fn sides(steps: &[StepMarker]) -> Vec<f64> {
    let (mut before, mut side) = (SAFE_OPENING, 0.0);
    let side_of = |step: &StepMarker| {
        let moved = step.valve_opening_ratio - before;
        if moved.abs() > SAME_OPENING {
            (before, side) = (step.valve_opening_ratio, moved.signum());
        }
        side
    };
    steps.iter().map(side_of).collect()
}

pub(crate) fn rows(
    steps: &[(Opening, Readings)],
    noise: &PerChannel,
    nominal: Option<&NominalRig<'_>>,
) -> Option<Rows> {
    let known = |step: &&(Opening, Readings)| {
        let (opening, readings) = step;
        opening.position > 0.0
            && readings.p2_pa() - readings.p1_pa() > EXCLUDE_SIGMAS * BACK_PRESSURE_SIGMA_PA
            && ln_area(readings).is_finite()
    };
    let known: Vec<&(Opening, Readings)> = steps.iter().filter(known).collect();
    let count = known.len();
    if count == 0 {
        return None;
    }
    let openings: Vec<f64> = known.iter().map(|(opening, _)| opening.position).collect();
    let by_play = known.iter().map(|(opening, _)| -0.5 * opening.side / opening.position).collect();
    let readings: Vec<Readings> = known.iter().map(|(_, readings)| *readings).collect();
    let by_reading: Vec<PerChannel> = readings.iter().map(|readings| readings.derivatives(ln_area)).collect();
    let behind: Vec<f64> = by_reading.iter().map(|by| by[3]).collect();
    let ln_ratio = |k: usize| (readings[k].p2_pa() / readings[k].p1_pa()).ln();
    let discharge = DMatrix::from_fn(count, count, |i, j| {
        DISCHARGE_RATIO.powi(2) * (-0.5 * ((ln_ratio(i) - ln_ratio(j)) / DISCHARGE_LENGTH).powi(2)).exp()
    });
    let mut covariance = own(errors(&by_reading, noise, VALVE_REPEATABILITY).into_iter())
        + common(&behind, BACK_PRESSURE_SIGMA_PA);
    let mut by_machine = vec![(Machine::ValvePlay, by_play)];
    let expected: Vec<f64> = match nominal {
        Some(nominal) => {
            let outlet = &nominal.model.params.outlet;
            let sigma = nominal.tolerances.valve_area_ratio;
            covariance += common(&vec![1.0; count], sigma);
            by_machine.push((Machine::ValveArea, vec![1.0; count]));
            let whole = outlet.discharge_coefficient * outlet.valve_area_m2;
            openings.iter().map(|opening| (opening * whole).ln()).collect()
        }
        None => {
            let same = |i: usize, j: usize| (openings[i] - openings[j]).abs() < SAME_OPENING;
            covariance += discharge;
            let any = UNINFORMATIVE * VALVE_REPEATABILITY;
            covariance += DMatrix::from_fn(count, count, |i, j| if same(i, j) { any * any } else { 0.0 });
            let middle = readings.iter().map(ln_area).sum::<f64>() / count as f64;
            vec![middle; count]
        }
    };
    let residual = readings.iter().zip(expected).map(|(readings, expected)| ln_area(readings) - expected);
    Some(Rows {
        residual: residual.collect(),
        covariance,
        readings,
        by_reading,
        by_machine,
        by_fault: Vec::new(),
    })
}

/// ln of the valve's area, including the discharge coefficient, m2.
fn ln_area(readings: &Readings) -> f64 {
    let per_m2 = orifice::flow_kg_s(1.0, readings.p2_pa(), readings.t2_k(), readings.p1_pa());
    (readings.flow_kg_s() / per_m2).ln()
}
