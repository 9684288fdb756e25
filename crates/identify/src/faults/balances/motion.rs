//! Motion of P3 and valve: both follow their commands as late as declared.
//!
//! The delay in a jump is the integral of the share of the jump that the actuator lacks. Lag, dead time and limited rate all add to it, so that
//! it needs no shape of the motion. P3 comes from its reading, the valve from flow and pressures.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{Rows, common, own};
use crate::faults::end_readings::{CHANNELS, Readings};
use crate::faults::found_fault::Machine;
use mapper_core::{ActuatorMotion, Channel, Recording, RigActuators};
use mapper_numerics::statistics::{mean, median};
use mapper_observe::averages::Table;
use mapper_observe::model_inputs::lagged_command::{LaggedCommand, Response, valve_areas_m2};
use mapper_physics::gas::air::Air;
use mapper_physics::rig::sensor_fault::ExactReadings;

/// Time before a jump whose readings are its start, s. Bound: shorter than any step, and longer than the noise.
const BEFORE_S: f64 = 3.0;
/// Share of a step at its end that counts as the end of its jump. Bound: that of the search for a lag.
const SETTLED_SHARE: f64 = 0.3;
/// Smallest jump relative to the largest. Bound: smaller ones have a large error of their delay.
const JUMP_SHARE: f64 = 0.3;
/// Range of the measured jump over the commanded one, as logarithms. Bound: an actuator outside does not follow.
const FOLLOWS: std::ops::Range<f64> = 0.5..2.0;
/// Error of the delay in one jump, one standard deviation, s. Bound: three samples at 10 Hz.
const OWN_DELAY_S: f64 = 0.3;
/// Error of all delays, one standard deviation, s and share of the declared one. Judgement: the interval of a commissioning is a tenth.
const COMMON_DELAY: (f64, f64) = (0.1, 0.2);
/// Fewest jumps. Bound: a scatter has a meaning.
const MIN_JUMPS: usize = 4;
/// Standard deviation over the median absolute deviation of a normal distribution. Source: definition.
const MAD_RATIO: f64 = 1.4826;

/// The rows of each actuator; none in recordings of other programs, whose commands mean anything. `outlet_volume_m3`: before the valve, 0 if unknown.
pub(crate) fn rows(recording: &Recording, config: &IdentifyConfig, outlet_volume_m3: f64) -> Vec<Rows> {
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
    let jump = |pair: &[mapper_core::StepMarker]| {
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
