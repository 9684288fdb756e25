//! P3 behind its command: a first-order lag, and its time constant as recorded.

use crate::table::Table;
use mapper_core::{Channel, StepMarker};
use mapper_numerics::minimise::minimise;

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

    /// The response to the commands of a recording's steps, at least one.
    pub fn of_steps(steps: &[StepMarker], lag_s: f64) -> Self {
        let level = |step: &StepMarker| Level {
            start_s: step.start_s,
            p3_pa: step.p3_pa,
            valve_opening_ratio: step.valve_opening_ratio,
        };
        LaggedCommand::new(steps.iter().map(level).collect(), lag_s)
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

/// Lags that are tried before the closer search.
const LOOKS: usize = 24;

/// Time constant of the measured P3 behind its command, s, and its standard error; `None` without jumps or P3.
///
/// The minimum squared residual of the first seconds after each jump; the level after it is free, so that
/// no offset enters.
pub fn measured_lag_s(table: &Table, steps: &[StepMarker], noise_sigma: f64) -> Option<(f64, f64)> {
    let values = table.column(Channel::P3)?;
    let jumps: Vec<f64> = steps
        .windows(2)
        .filter(|pair| (pair[1].p3_pa - pair[0].p3_pa).abs() > 10.0 * noise_sigma.max(1.0))
        .map(|pair| pair[1].start_s)
        .collect();
    if jumps.is_empty() {
        return None;
    }
    let cost = |lag_s: f64| {
        let command = LaggedCommand::of_steps(steps, lag_s);
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
    // In the logarithm, from 1 ms to 60 s. A coarse look first: the cost has one valley for first-order responses only.
    let (shortest, longest) = (1e-3f64.ln(), 60f64.ln());
    let place = |i: usize| shortest + (longest - shortest) * i as f64 / LOOKS as f64;
    let costs: Vec<f64> = (0..=LOOKS).map(|i| cost(place(i).exp())).collect();
    let best = (0..=LOOKS).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    let (low, high) = (place(best.saturating_sub(1)), place((best + 1).min(LOOKS)));
    let lag_s = minimise(low, high, 1e-6, |x| cost(x.exp())).at.exp();
    // Curvature of the cost gives the error.
    let away_s = 0.02 * lag_s;
    let curvature = (cost(lag_s + away_s) + cost(lag_s - away_s) - 2.0 * cost(lag_s)) / (away_s * away_s);
    let error_s = if curvature > 0.0 { (2.0 / curvature).sqrt() } else { lag_s };
    Some((lag_s, error_s))
}
