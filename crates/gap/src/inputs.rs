//! What drives the model: the boundary conditions as recorded, without their noise.
//!
//! P3 is its command behind a first-order lag, whose time constant is read off the measured P3, plus the smooth rest.
//! Other quantities may jump along with P3 (P4 does, by the flow): that share is found by regression, and the rest is
//! smooth. A jump is never smoothed over.

use crate::smoother::{Course, smooth};
use crate::table::Table;
use mapper_core::{Channel, DeclaredUncertainty, NoiseColour, StepMarker};
use mapper_physics::inputs::Inputs;
use mapper_physics::params::BoundaryConditions;
use std::collections::BTreeMap;

/// A commanded level from a time on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Time of the change, s.
    pub start_s: f64,
    /// Commanded P3, Pa.
    pub p3_pa: f64,
    /// Commanded valve opening.
    pub valve_opening_ratio: f64,
}

/// P3 behind its command.
#[derive(Debug, Clone, PartialEq)]
pub struct LaggedCommand {
    levels: Vec<Level>,
    /// P3 at the start of each level, Pa.
    at_start_pa: Vec<f64>,
    /// Time constant, s.
    pub lag_s: f64,
}

impl LaggedCommand {
    /// The response to `levels` (rising in time, at least one) with time constant `lag_s`, from rest.
    pub fn new(levels: Vec<Level>, lag_s: f64) -> Self {
        let mut at_start_pa = Vec::with_capacity(levels.len());
        for (index, level) in levels.iter().enumerate() {
            let value = match index.checked_sub(1) {
                None => level.p3_pa,
                Some(before) => {
                    let (from, held) = (&levels[before], at_start_pa[before]);
                    approach(held, from.p3_pa, level.start_s - from.start_s, lag_s)
                }
            };
            at_start_pa.push(value);
        }
        LaggedCommand { levels, at_start_pa, lag_s }
    }

    /// The level that holds at `t_s`.
    pub fn level(&self, t_s: f64) -> usize {
        self.levels.partition_point(|level| level.start_s <= t_s).saturating_sub(1)
    }

    /// P3 at `t_s`, Pa.
    pub fn p3_pa(&self, t_s: f64) -> f64 {
        let index = self.level(t_s);
        let level = &self.levels[index];
        approach(self.at_start_pa[index], level.p3_pa, t_s - level.start_s, self.lag_s)
    }

    /// Commanded levels.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }
}

fn approach(from: f64, to: f64, elapsed_s: f64, lag_s: f64) -> f64 {
    if lag_s > 0.0 { to + (from - to) * (-elapsed_s.max(0.0) / lag_s).exp() } else { to }
}

/// A recorded quantity without its noise: smooth, plus a share of P3's own course.
#[derive(Debug, Clone, PartialEq)]
pub struct Driver {
    /// The smooth part.
    pub course: Course,
    /// Change for each pascal of P3.
    pub along_p3: f64,
}

/// Fixed offsets taken from the recorded inputs, in each channel's unit: what the sensor reads too high.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InputOffsets {
    /// Of T1, K.
    pub t1_k: f64,
    /// Of P1, Pa.
    pub p1_pa: f64,
    /// Of P3, Pa.
    pub p3_pa: f64,
    /// Of T3, K.
    pub t3_k: f64,
    /// Of P4, Pa.
    pub p4_pa: f64,
    /// Of T_oil, K.
    pub oil_k: f64,
    /// Of the ambient temperature taken, K.
    pub ambient_k: f64,
}

/// Boundary conditions over time.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivenInputs {
    /// P3 by its command.
    pub command: LaggedCommand,
    p3_rest: Course,
    t1: Driver,
    p1: Driver,
    t3: Driver,
    p4: Driver,
    oil: Driver,
    /// Ambient temperature where one is recorded or declared; T1 otherwise.
    ambient: Option<Driver>,
    /// What is taken off.
    pub offsets: InputOffsets,
}

/// What the recording alone says of its inputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputNoise {
    /// The input.
    pub channel: Channel,
    /// Standard deviation of its course, in its unit.
    pub sigma: f64,
    /// Time over which the error stays alike, s.
    pub correlation_s: f64,
}

/// What is missing for driving the model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InputError {
    /// A channel that drives the model is not recorded and not declared.
    #[error("{channel} ({}) drives the model, and is neither recorded nor declared in the campaign", .channel.info().description)]
    Missing {
        /// The channel.
        channel: Channel,
    },
}

/// What is declared where nothing is recorded.
#[derive(Debug, Clone, Default)]
pub struct InputDeclarations {
    /// Sensors' uncertainty.
    pub sensors: BTreeMap<Channel, DeclaredUncertainty>,
    /// Their noise over time.
    pub noise_colour: NoiseColour,
    /// Boundary conditions of the campaign, for channels that are not recorded.
    pub nominal: BoundaryConditions,
}

impl DrivenInputs {
    /// Reads the inputs off a recording.
    ///
    /// # Errors
    /// [`InputError::Missing`] without a measured or commanded P3.
    pub fn read(
        table: &Table,
        steps: &[StepMarker],
        declared: &InputDeclarations,
        lag_s: f64,
    ) -> Result<DrivenInputs, InputError> {
        let levels: Vec<Level> = steps
            .iter()
            .map(|step| Level {
                start_s: step.start_s,
                p3_pa: step.p3_pa,
                valve_opening_ratio: step.valve_opening_ratio,
            })
            .collect();
        let command = LaggedCommand::new(levels, lag_s);
        let along: Vec<f64> = table.t_s.iter().map(|t| command.p3_pa(*t)).collect();
        let noise = |channel: Channel| declared.sensors.get(&channel).map_or(0.0, |s| s.noise_sigma);
        let smoothed = |channel: Channel, values: &[f64]| {
            smooth(&table.t_s, values, noise(channel), declared.noise_colour)
        };
        let p3_rest = match table.column(Channel::P3) {
            Some(values) => {
                let rest: Vec<f64> = values.iter().zip(&along).map(|(p3, a)| p3 - a).collect();
                smoothed(Channel::P3, &rest).unwrap_or_else(|| Course::constant(0.0))
            }
            None => Course::constant(0.0),
        };
        let driver = |channel: Channel| -> Option<Driver> {
            let values = table.column(channel)?;
            let along_p3 = share_along(table, values, &command, noise(channel));
            let rest: Vec<f64> = values.iter().zip(&along).map(|(v, a)| v - along_p3 * a).collect();
            Some(Driver { course: smoothed(channel, &rest)?, along_p3 })
        };
        let held = |value: f64| Driver { course: Course::constant(value), along_p3: 0.0 };
        let nominal = &declared.nominal;
        let or_held = |channel: Channel, value: f64| driver(channel).unwrap_or_else(|| held(value));
        Ok(DrivenInputs {
            p3_rest,
            t1: or_held(Channel::T1, nominal.t1_k),
            p1: or_held(Channel::P1, nominal.p1_pa),
            t3: or_held(Channel::T3, nominal.t3_k),
            p4: or_held(Channel::P4, nominal.p4_pa),
            oil: or_held(Channel::TOil, nominal.oil_temperature_k),
            ambient: driver(Channel::TAmb).or_else(|| Some(held(nominal.ambient_temperature_k))),
            offsets: InputOffsets::default(),
            command,
        })
    }

    /// How well each input is known, beyond its fixed offset.
    pub fn noise(&self) -> [InputNoise; 6] {
        let row = |channel, course: &Course| InputNoise {
            channel,
            sigma: course.sigma,
            correlation_s: course.correlation_s,
        };
        [
            row(Channel::T1, &self.t1.course),
            row(Channel::P1, &self.p1.course),
            row(Channel::P3, &self.p3_rest),
            row(Channel::T3, &self.t3.course),
            row(Channel::P4, &self.p4.course),
            row(Channel::TOil, &self.oil.course),
        ]
    }
}

impl Inputs for DrivenInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let by_command_pa = self.command.p3_pa(t_s);
        let value = |driver: &Driver| driver.course.at(t_s) + driver.along_p3 * by_command_pa;
        let offsets = &self.offsets;
        let t1_k = value(&self.t1) - offsets.t1_k;
        BoundaryConditions {
            t1_k,
            p1_pa: value(&self.p1) - offsets.p1_pa,
            p3_pa: by_command_pa + self.p3_rest.at(t_s) - offsets.p3_pa,
            t3_k: value(&self.t3) - offsets.t3_k,
            p4_pa: value(&self.p4) - offsets.p4_pa,
            oil_temperature_k: value(&self.oil) - offsets.oil_k,
            ambient_temperature_k: self.ambient.as_ref().map_or(t1_k, value) - offsets.ambient_k,
            valve_opening_ratio: self.command.levels()[self.command.level(t_s)].valve_opening_ratio,
        }
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        let after = self.command.levels().partition_point(|level| level.start_s <= t_s);
        self.command.levels().get(after).map_or(f64::INFINITY, |level| level.start_s)
    }

    fn is_constant_after(&self, _t_s: f64) -> bool {
        false
    }
}

/// Length of the stretches beside a jump from which its height is taken, s.
const BESIDE_S: f64 = 8.0;

/// Change of `values` per pascal of P3, from their jumps at P3's jumps; 0 where they do not follow it.
fn share_along(table: &Table, values: &[f64], command: &LaggedCommand, noise_sigma: f64) -> f64 {
    let (mut sum_xy, mut sum_xx, mut pairs) = (0.0, 0.0, Vec::new());
    for pair in command.levels().windows(2) {
        let jump_s = pair[1].start_s;
        let height_pa = pair[1].p3_pa - pair[0].p3_pa;
        let settled_s = jump_s + 6.0 * command.lag_s;
        let (Some(before), Some(after)) = (
            line_at(table, values, jump_s - BESIDE_S, jump_s, jump_s),
            line_at(table, values, settled_s, settled_s + BESIDE_S, jump_s),
        ) else {
            continue;
        };
        pairs.push((height_pa, after - before));
        sum_xy += height_pa * (after - before);
        sum_xx += height_pa * height_pa;
    }
    if sum_xx <= 0.0 || pairs.len() < 3 {
        return 0.0;
    }
    let share = sum_xy / sum_xx;
    let scatter = pairs.iter().map(|(x, y)| (y - share * x).powi(2)).sum::<f64>() / (pairs.len() - 1) as f64;
    // Never better than the noise allows.
    let error = (scatter.max(noise_sigma * noise_sigma * 0.1) / sum_xx).sqrt();
    if share.abs() > 6.0 * error { share } else { 0.0 }
}

/// A line through the values between two times, read at `at_s`.
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
    (n >= 8.0 && determinant > 0.0).then(|| (stt * sv - st * stv) / determinant)
}

/// Time constant of the measured P3 behind its command, s, and its standard error; `None` without jumps or P3.
///
/// Golden section on the squared residual of the first seconds after each jump; the level after it is free, so that
/// no offset enters.
pub fn measured_lag_s(table: &Table, steps: &[StepMarker], noise_sigma: f64) -> Option<(f64, f64)> {
    let values = table.column(Channel::P3)?;
    let levels: Vec<Level> = steps
        .iter()
        .map(|s| Level { start_s: s.start_s, p3_pa: s.p3_pa, valve_opening_ratio: s.valve_opening_ratio })
        .collect();
    let jumps: Vec<f64> = levels
        .windows(2)
        .filter(|pair| (pair[1].p3_pa - pair[0].p3_pa).abs() > 10.0 * noise_sigma.max(1.0))
        .map(|pair| pair[1].start_s)
        .collect();
    if jumps.is_empty() {
        return None;
    }
    let cost = |lag_s: f64| {
        let command = LaggedCommand::new(levels.clone(), lag_s);
        let mut total = 0.0;
        for jump_s in &jumps {
            let range = table.range(jump_s - 3.0, jump_s + 12.0);
            let rest: Vec<f64> = range
                .filter(|i| values[*i].is_finite())
                .map(|i| values[i] - command.p3_pa(table.t_s[i]))
                .collect();
            let mean = rest.iter().sum::<f64>() / rest.len().max(1) as f64;
            total += rest.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>();
        }
        total / (noise_sigma * noise_sigma).max(1e-9)
    };
    // In the logarithm: 1 ms to 60 s.
    let golden = 0.618_033_988_749_895;
    let (mut low, mut high) = (1e-3f64.ln(), 60f64.ln());
    // A coarse look first: the cost has one valley for first-order responses only.
    let coarse: Vec<f64> = (0..=24).map(|i| low + (high - low) * f64::from(i) / 24.0).collect();
    let costs: Vec<f64> = coarse.iter().map(|x| cost(x.exp())).collect();
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    (low, high) = (coarse[best.saturating_sub(1)], coarse[(best + 1).min(24)]);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut cost_a, mut cost_b) = (cost(a.exp()), cost(b.exp()));
    for _ in 0..24 {
        if cost_a < cost_b {
            (high, b, cost_b) = (b, a, cost_a);
            a = high - golden * (high - low);
            cost_a = cost(a.exp());
        } else {
            (low, a, cost_a) = (a, b, cost_b);
            b = low + golden * (high - low);
            cost_b = cost(b.exp());
        }
    }
    let lag_s = (0.5 * (low + high)).exp();
    // Curvature of the cost gives the error.
    let away_s = 0.02 * lag_s;
    let curvature = (cost(lag_s + away_s) + cost(lag_s - away_s) - 2.0 * cost(lag_s)) / (away_s * away_s);
    let error_s = if curvature > 0.0 { (2.0 / curvature).sqrt() } else { lag_s };
    Some((lag_s, error_s))
}
