//! Flow through the back-pressure valve: one opening has one area, and a valve that does not follow its commands keeps its area.
//!
//! `m sqrt(T2)/(P2 psi(P1/P2))`, with the St. Venant and Wantzel function psi of an orifice that discharges to the inlet pressure, is the area
//! of the valve. Without a declared valve the area is unknown, and need not be proportional to the opening.
//!
//! Valve and P3 also follow their commands as late as declared. The delay in a jump is the integral of the share of the jump that the actuator
//! lacks: lag, dead time and limited rate all add to it, so that it needs no shape of the motion.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{Rows, common, errors, own};
use crate::faults::end_readings::{CHANNELS, PerChannel, Readings};
use crate::faults::found_fault::Machine;
use crate::faults::nominal_rig::NominalRig;
use mapper_core::{ActuatorMotion, Channel, Recording, RigActuators, StepMarker};
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, mean, median};
use mapper_observe::averages::Table;
use mapper_observe::model_inputs::lagged_command::{LaggedCommand, Response, SAFE_OPENING, valve_areas_m2};
use mapper_observe::perturbation::UNINFORMATIVE;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::turbine;
use mapper_physics::rig::sensor_fault::ExactReadings;
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

/// Time before a jump whose readings are its start, s. Bound: shorter than any step, and longer than the correlation of the noise, 2 s.
const BEFORE_S: f64 = 3.0;
/// Share of a step at its end that counts as the end of its jump. Bound: that of the search for a lag.
const SETTLED_SHARE: f64 = 0.3;
/// Smallest jump relative to the largest. Bound: smaller ones have a large error of their delay.
const JUMP_SHARE: f64 = 0.3;
/// Range of the measured jump over the commanded one, as logarithms. Bound: an actuator outside does not follow.
const FOLLOWS: std::ops::Range<f64> = 0.5..2.0;
/// Error of the delay in one jump, one standard deviation, s. Bound: three samples at 10 Hz.
const OWN_DELAY_S: f64 = 0.3;
/// Error of all delays, one standard deviation, s and share of the declared one. Bound: the interval of a commissioning is a tenth of it.
const COMMON_DELAY: (f64, f64) = (0.1, 0.2);
/// Fewest jumps. Bound: the median deviation of three says little of their scatter.
const MIN_JUMPS: usize = 4;
/// Standard deviation over the median absolute deviation of a normal distribution. Source: definition.
const MAD_RATIO: f64 = 1.4826;

/// The rows of each actuator; none in recordings of other programs, whose commands may have any meaning. `outlet_volume_m3`: before the valve, 0 if unknown.
pub(crate) fn motion_rows(
    recording: &Recording,
    config: &IdentifyConfig,
    outlet_volume_m3: f64,
) -> Vec<Rows> {
    let declared = config.actuators.filter(|_| config.opening_is_area);
    let (Some(declared), Some(table)) = (declared, Table::new(recording)) else { return Vec::new() };
    let RigActuators { valve_play_ratio: play, valve_dead_band_ratio: dead_band, p3, valve, .. } = declared;
    let response = |motion: ActuatorMotion| Response {
        lag_s: motion.lag_s,
        slew_per_s: motion.rate_per_s,
        dead_time_s: motion.dead_time_s,
        play: 0.0,
        dead_band: 0.0,
    };
    let with_play = Response { play, dead_band, ..response(valve) };
    let expected = LaggedCommand::of_recording(recording, response(p3), with_play);
    let air = table.column(Channel::P3).map(|values| {
        let delays = delays_s(recording, &table, values, |t_s| expected.p3_pa(t_s));
        (Machine::SlowAir, p3, delays)
    });
    let areas = valve_areas_m2(&table, (config.reference.p_ref_pa, outlet_volume_m3));
    let areas = areas.map(|values| {
        let delays = delays_s(recording, &table, &values, |t_s| expected.valve_opening_ratio(t_s));
        (Machine::SlowValve, valve, delays)
    });
    let rows = |(machine, motion, delays): (Machine, ActuatorMotion, Vec<f64>)| {
        let middle_s = median(&delays).filter(|_| delays.len() >= MIN_JUMPS)?;
        let off = delays.iter().map(|delay_s| (delay_s - middle_s).abs());
        let scatter_s = MAD_RATIO * median(off.collect::<Vec<f64>>().iter())?;
        let count = delays.len();
        let all = vec![1.0; count];
        let common_s = COMMON_DELAY.0.hypot(COMMON_DELAY.1 * (motion.lag_s + motion.dead_time_s));
        let readings = Readings {
            values: [f64::NAN; CHANNELS.len()],
            run_ratio: 0.0,
            exact_at: ExactReadings::default(),
            air: Air::DRY,
        };
        Some(Rows {
            covariance: own(vec![OWN_DELAY_S.hypot(scatter_s); count].into_iter()) + common(&all, common_s),
            residual: delays,
            // No sensor's error changes a delay.
            readings: vec![readings; count],
            by_reading: vec![[0.0; CHANNELS.len()]; count],
            by_machine: vec![(machine, all)],
            by_fault: Vec::new(),
        })
    };
    [air, areas].into_iter().flatten().filter_map(rows).collect()
}

/// Delay of the readings behind what is expected in each large jump, s.
fn delays_s(recording: &Recording, table: &Table, values: &[f64], expected: impl Fn(f64) -> f64) -> Vec<f64> {
    let level = |start_s: f64, end_s: f64| {
        let samples = table.range(start_s, end_s).filter(|i| values[*i].is_finite());
        let (read, want): (Vec<f64>, Vec<f64>) = samples.map(|i| (values[i], expected(table.t_s[i]))).unzip();
        Some((mean(read)?, mean(want)?))
    };
    let jump = |pair: &[StepMarker]| {
        let (start_s, end_s) = (pair[1].start_s, pair[1].end_s);
        if pair[0].end_s - pair[0].start_s < BEFORE_S || start_s - pair[0].end_s > BEFORE_S {
            return None;
        }
        let before = level(start_s - BEFORE_S, start_s)?;
        let after = level(end_s - SETTLED_SHARE * (end_s - start_s), end_s)?;
        let (read_ln, want_ln) = ((after.0 / before.0).ln(), (after.1 / before.1).ln());
        let share = |value: f64, from: f64, to: f64| (value - from) / (to - from);
        let samples = table.range(start_s, end_s).filter(|i| values[*i].is_finite());
        let lacking = samples
            .map(|i| share(expected(table.t_s[i]), before.1, after.1) - share(values[i], before.0, after.0));
        let delay_s = mean(lacking.collect::<Vec<f64>>())? * (end_s - start_s);
        (FOLLOWS.contains(&(read_ln / want_ln)) && delay_s.is_finite()).then_some((want_ln.abs(), delay_s))
    };
    let jumps: Vec<(f64, f64)> = recording.steps.windows(2).filter_map(jump).collect();
    let largest = jumps.iter().map(|(size, _)| *size).fold(0.0, f64::max);
    jumps.into_iter().filter(|(size, _)| *size >= JUMP_SHARE * largest).map(|(_, delay_s)| delay_s).collect()
}
