//! Flow through the back-pressure valve: one opening has one area, and a valve that does not follow its commands keeps its area.
//!
//! `m sqrt(T2)/(P2 psi(P1/P2))`, with the St. Venant and Wantzel function psi of an orifice that discharges to the inlet pressure, is the area
//! of the valve. Without a declared valve the area is unknown, and need not be proportional to the opening.

use crate::faults::balance_rows::{Rows, common, errors, own};
use crate::faults::end_readings::{PerChannel, Readings};
use crate::faults::found_fault::Machine;
use crate::faults::nominal_rig::NominalRig;
use mapper_core::StepMarker;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, mean, median};
use mapper_observe::model_inputs::lagged_command::SAFE_OPENING;
use mapper_observe::perturbation::UNINFORMATIVE;
use mapper_physics::laws::turbine;
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
/// Deviation of a valve's area from its opening, one standard deviation. Bound: the linearity of characterised valves is some per cent of their span.
const OPENING_RATIO: f64 = 0.1;
/// Repeatability of a valve's area, one standard deviation. Bound: a positioner resolves some tenths of a per cent of the travel.
const VALVE_REPEATABILITY: f64 = 0.005;

/// The valve in a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Opening {
    /// Index of the step.
    pub(crate) step: usize,
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

pub(crate) fn valve_rows(
    steps: &[(Opening, Readings)],
    noise: &PerChannel,
    nominal: Option<&NominalRig<'_>>,
    opening_is_area: bool,
) -> Option<Rows> {
    let known = |step: &&(Opening, Readings)| {
        let (opening, readings) = step;
        opening.position > 0.0
            && readings.p2_pa() - readings.p1_pa() > EXCLUDE_SIGMAS * BACK_PRESSURE_SIGMA_PA
            && ln_area(readings).is_finite()
    };
    let (openings, readings): (Vec<Opening>, Vec<Readings>) =
        steps.iter().filter(known).map(|(opening, readings)| (*opening, *readings)).unzip();
    let count = openings.len();
    if count == 0 {
        return None;
    }
    let by_play = openings.iter().map(|opening| -0.5 * opening.side / opening.position).collect();
    let by_reading: Vec<PerChannel> = readings.iter().map(|readings| readings.derivatives(ln_area)).collect();
    let behind: Vec<f64> = by_reading.iter().map(|by| by[3]).collect();
    let ln_ratio = |k: usize| (readings[k].p2_pa() / readings[k].p1_pa()).ln();
    let discharge = DMatrix::from_fn(count, count, |i, j| {
        DISCHARGE_RATIO.powi(2) * (-0.5 * ((ln_ratio(i) - ln_ratio(j)) / DISCHARGE_LENGTH).powi(2)).exp()
    });
    let mut covariance = own(errors(&by_reading, noise, VALVE_REPEATABILITY).into_iter())
        + common(&behind, BACK_PRESSURE_SIGMA_PA);
    let areas: Vec<f64> = readings.iter().map(ln_area).collect();
    let mut by_machine = vec![(Machine::ValvePlay, by_play)];
    let expected: Vec<f64> = match nominal {
        Some(nominal) => {
            let outlet = &nominal.model.params.outlet;
            let sigma = nominal.tolerances.valve_area_ratio;
            covariance += common(&vec![1.0; count], sigma);
            by_machine.push((Machine::ValveArea, vec![1.0; count]));
            let whole = outlet.discharge_coefficient * outlet.valve_area_m2;
            openings.iter().map(|opening| (opening.position * whole).ln()).collect()
        }
        None => {
            covariance += discharge;
            let any = UNINFORMATIVE * VALVE_REPEATABILITY;
            let same = |i: usize, j: usize| openings[i].is_same_as(&openings[j]);
            let own_area = if opening_is_area { OPENING_RATIO } else { any };
            covariance +=
                DMatrix::from_fn(count, count, |i, j| if same(i, j) { own_area * own_area } else { 0.0 });
            let ln_opening = |opening: &Opening| if opening_is_area { opening.position.ln() } else { 0.0 };
            if opening_is_area {
                covariance += common(&vec![1.0; count], any);
            }
            let off = areas.iter().zip(&openings).map(|(area, opening)| area - ln_opening(opening));
            let nominal_area = median(off.collect::<Vec<f64>>().iter()).unwrap_or_default();
            openings.iter().map(|opening| nominal_area + ln_opening(opening)).collect()
        }
    };
    let of_command = (nominal.is_some() || opening_is_area).then_some(expected.as_slice());
    by_machine.extend(stuck(&openings, &areas, of_command));
    Some(Rows {
        residual: areas.iter().zip(expected).map(|(area, expected)| area - expected).collect(),
        covariance,
        readings,
        by_reading,
        by_machine,
        by_fault: Vec::new(),
    })
}

impl Opening {
    fn is_same_as(&self, other: &Opening) -> bool {
        (self.position - other.position).abs() < SAME_OPENING
    }
}

/// The longest series of steps with one area under commands for several: the valve may stand still in them. The effect of such a valve on the
/// residuals is the difference between its area and that of each command: `expected` of the declared valve, or that of the same
/// command in other steps.
fn stuck(openings: &[Opening], areas: &[f64], expected: Option<&[f64]>) -> Vec<(Machine, Vec<f64>)> {
    let one_area = EXCLUDE_SIGMAS * DISCHARGE_RATIO;
    let (mut found, mut end) = (Vec::new(), 0);
    for first in 0..areas.len() {
        let count = areas[first..].iter().take_while(|area| (*area - areas[first]).abs() < one_area).count();
        let steps = first..first + count;
        if steps.end <= end {
            continue;
        }
        end = steps.end;
        let Some(area) = mean(areas[steps.clone()].iter().copied()) else { continue };
        let commanded = |index: usize| match expected {
            Some(expected) => Some(expected[index]),
            None => mean(
                (0..areas.len())
                    .filter(|other| !steps.contains(other) && openings[*other].is_same_as(&openings[index]))
                    .map(|other| areas[other]),
            ),
        };
        let missing = |index: usize| match steps.contains(&index) {
            true => commanded(index).map_or(0.0, |commanded| area - commanded),
            false => 0.0,
        };
        let column: Vec<f64> = (0..areas.len()).map(missing).collect();
        let moves = openings[steps.clone()].iter().any(|opening| !opening.is_same_as(&openings[first]));
        if moves && column.iter().any(|missing| missing.abs() > one_area) {
            // The command of this area: of the declared valve, or the first that it has reached.
            let opening_ratio = match expected {
                Some(expected) => openings[first].position * (area - expected[first]).exp(),
                None => openings[first].position,
            };
            let steps = (openings[first].step, openings[steps.end - 1].step);
            found.push((Machine::ValveStuck { first: steps.0, last: steps.1, opening_ratio }, column));
        }
    }
    found
}

/// ln of the valve's area, including the discharge coefficient, m2.
pub(crate) fn ln_area(readings: &Readings) -> f64 {
    let per_m2 = turbine::flow_kg_s(1.0, readings.p2_pa(), readings.t2_k(), readings.p1_pa());
    (readings.flow_kg_s() / per_m2).ln()
}
