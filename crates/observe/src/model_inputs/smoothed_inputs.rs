//! The recorded boundary conditions as model inputs, without their noise.
//!
//! P3 is its command with a first-order lag, whose time constant is fitted to the measured P3, plus a remainder. The remainder and other
//! quantities may jump with P3 (P4 does, because of the flow; the remainder, by the gain error of the transducer): regression gives that
//! share, and the remainder is smooth. Jumps are not smoothed.

use crate::averages::{INPUT_CHANNELS, Table, boundary_condition};
use crate::declared::Declared;
use crate::model_inputs::lagged_command::{LaggedCommand, Response, commanded_s, levels_of_step};
use crate::model_inputs::smoother::{TimeHistory, smooth};
use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::MIN_VALUES;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::steady::Inputs;

/// Minimum variance of a jump's height, ratio to that of a sample. Bound: the height is a mean over at least ten samples.
const HEIGHT_VARIANCE_RATIO: f64 = 0.1;

/// A recorded quantity without its noise: a smooth part, plus a part proportional to P3.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothInput {
    /// The smooth part.
    pub history: TimeHistory,
    /// Change per pascal of P3.
    pub per_p3: f64,
}

/// Recorded boundary conditions over time, without their noise.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothedInputs {
    /// P3 according to its command.
    pub command: LaggedCommand,
    /// Starts of the steps, s. Changes within a step by a speed-control loop are too small to interrupt an integration.
    jumps_s: Vec<f64>,
    /// P3 minus its command.
    p3_remainder: SmoothInput,
    /// Every other boundary condition by its channel.
    inputs: Vec<(Channel, SmoothInput)>,
    nominal: BoundaryConditions,
}

/// Uncertainty of an input from the recording alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputNoise {
    /// Standard deviation of its time history, in its unit.
    pub sigma: f64,
    /// Correlation time of the error, s.
    pub correlation_s: f64,
}

impl SmoothedInputs {
    /// Takes the inputs from a recording, with the given responses of P3 and the valve. The campaign's values replace channels that are not
    /// recorded.
    pub fn read(
        table: &Table,
        recording: &Recording,
        declared: &Declared,
        (p3, valve): (Response, Response),
    ) -> SmoothedInputs {
        let command = LaggedCommand::of_recording(recording, p3, valve);
        let commanded_p3: Vec<f64> = table.t_s.iter().map(|t| command.p3_pa(*t)).collect();
        let jumps_s: Vec<f64> = recording.steps.iter().map(|step| step.start_s).collect();
        let input = |channel: Channel, values: &[f64]| {
            let noise_sigma = declared.noise_sigma(channel);
            let p3 = (&command, commanded_p3.as_slice());
            let per_p3 = change_per_pascal((table, recording), values, p3, noise_sigma);
            let rest: Vec<f64> =
                values.iter().zip(&commanded_p3).map(|(value, p3)| value - per_p3 * p3).collect();
            let history = smooth(&table.t_s, &rest, noise_sigma, declared.noise_colour, &jumps_s)?;
            Some(SmoothInput { history, per_p3 })
        };
        let p3_remainder = table.column(Channel::P3).and_then(|values| {
            let remainder: Vec<f64> =
                values.iter().zip(&commanded_p3).map(|(p3, commanded)| p3 - commanded).collect();
            input(Channel::P3, &remainder)
        });
        let other = |channel: Channel| Some((channel, input(channel, table.column(channel)?)?));
        let others = INPUT_CHANNELS.into_iter().filter(|channel| *channel != Channel::P3);
        SmoothedInputs {
            p3_remainder: p3_remainder
                .unwrap_or_else(|| SmoothInput { history: TimeHistory::constant(0.0), per_p3: 0.0 }),
            inputs: others.chain([Channel::TAmb]).filter_map(other).collect(),
            nominal: declared.nominal,
            jumps_s,
            command,
        }
    }

    /// Uncertainty of each of [`INPUT_CHANNELS`] in addition to its fixed offset; `None` for those that are not recorded.
    pub fn noise(&self) -> [Option<InputNoise>; INPUT_CHANNELS.len()] {
        INPUT_CHANNELS.map(|channel| {
            let history = match channel {
                Channel::P3 => &self.p3_remainder.history,
                _ => &self.inputs.iter().find(|(other, _)| *other == channel)?.1.history,
            };
            Some(InputNoise { sigma: history.sigma, correlation_s: history.correlation_s })
        })
    }
}

impl Inputs for SmoothedInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let commanded_p3_pa = self.command.p3_pa(t_s);
        let of = |input: &SmoothInput| input.history.at(t_s) + input.per_p3 * commanded_p3_pa;
        let mut boundary = BoundaryConditions {
            p3_pa: commanded_p3_pa + of(&self.p3_remainder),
            valve_opening_ratio: self.command.valve_opening_ratio(t_s),
            ..self.nominal
        };
        for (channel, input) in &self.inputs {
            if let Some(value) = boundary_condition(&mut boundary, *channel) {
                *value = of(input);
            }
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        let after = self.jumps_s.partition_point(|jump_s| *jump_s <= t_s);
        self.jumps_s.get(after).copied().unwrap_or(f64::INFINITY)
    }

    fn is_constant_after(&self, _t_s: f64) -> bool {
        false
    }
}

/// Length of the segments before and after a jump that give its height, s. Bound: its mean has a third of the noise of a second; housings
/// hardly move.
const LEVEL_WINDOW_S: f64 = 8.0;

/// Change of `values` per pascal of P3, by regression of their jumps on those of P3, shrunk by its uncertainty (positive-part James-Stein
/// estimate: Efron and Morris, J. Am. Stat. Assoc. 68:117, 1973). `commanded_p3` is P3 according to its command.
fn change_per_pascal(
    (table, recording): (&Table, &Recording),
    values: &[f64],
    (command, commanded_p3): (&LaggedCommand, &[f64]),
    noise_sigma: f64,
) -> f64 {
    let (mut sum_xy, mut sum_xx, mut pairs) = (0.0, 0.0, Vec::new());
    let mut arrived_s = f64::NEG_INFINITY;
    for (before, step) in recording.steps.iter().zip(recording.steps.iter().skip(1)) {
        let jump_s = step.start_s;
        let sent_s = commanded_s(&levels_of_step(recording, step), step);
        let settled_s = sent_s + command.p3_settles_s(before.p3_pa, step.p3_pa);
        // The level before needs its time.
        let is_short = arrived_s > jump_s - LEVEL_WINDOW_S;
        arrived_s = sent_s;
        if is_short {
            continue;
        }
        let height = |values: &[f64]| {
            let before = line_at(table, values, jump_s - LEVEL_WINDOW_S, jump_s, jump_s)?;
            Some(line_at(table, values, settled_s, settled_s + LEVEL_WINDOW_S, jump_s)? - before)
        };
        let (Some(change), Some(height_pa)) = (height(values), height(commanded_p3)) else { continue };
        pairs.push((height_pa, change));
        sum_xy += height_pa * change;
        sum_xx += height_pa * height_pa;
    }
    if sum_xx <= 0.0 || pairs.len() < 3 {
        return 0.0;
    }
    let share = sum_xy / sum_xx;
    let scatter = pairs.iter().map(|(x, y)| (y - share * x).powi(2)).sum::<f64>() / (pairs.len() - 1) as f64;
    // The noise limits the scatter from below.
    let error = (scatter.max(noise_sigma * noise_sigma * HEIGHT_VARIANCE_RATIO) / sum_xx).sqrt();
    if share == 0.0 { 0.0 } else { share * (1.0 - (error / share).powi(2)).max(0.0) }
}

/// A line through the values between two times, evaluated at `at_s`.
fn line_at(table: &Table, values: &[f64], start_s: f64, end_s: f64, at_s: f64) -> Option<f64> {
    let range = table.range(start_s, end_s);
    let (mut n, mut st, mut sv, mut stt, mut stv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (t, v) in table.t_s[range.clone()].iter().zip(&values[range]).filter(|(_, v)| v.is_finite()) {
        let t = t - at_s;
        n += 1.0;
        st += t;
        sv += v;
        stt += t * t;
        stv += t * v;
    }
    let determinant = n * stt - st * st;
    (n >= MIN_VALUES as f64 && determinant > 0.0).then(|| (stt * sv - st * stv) / determinant)
}
