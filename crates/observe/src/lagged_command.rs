//! P3 behind its command: a first-order lag, and its time constant as recorded.

use crate::table::Table;
use mapper_core::{Channel, Recording, StepMarker};
use mapper_numerics::minimise::minimise;

/// Change of a command below which it counts as held.
const HELD_RATIO: f64 = 1e-6;

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

    /// The response to the commands of a recording, which has at least one step: a level for each step, and within it
    /// one for each further command of P3, as a loop that holds the speed gives them.
    pub fn of_recording(recording: &Recording, lag_s: f64) -> Self {
        let levels = recording.steps.iter().flat_map(|step| levels_of_step(recording, step));
        LaggedCommand::new(levels.collect(), lag_s)
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

/// The level that a step begins with, and those to which a loop that holds the speed moves it.
fn levels_of_step(recording: &Recording, step: &StepMarker) -> Vec<Level> {
    let (mut start_s, mut p3_pa) = (step.start_s, step.p3_pa);
    let level = |start_s, p3_pa| Level { start_s, p3_pa, valve_opening_ratio: step.valve_opening_ratio };
    let mut levels = vec![level(start_s, p3_pa)];
    let Some(command) = recording.series.get(&Channel::P3Command) else { return levels };
    let (t_s, values) = command.slice(step.start_s, step.end_s);
    // The first sample may have been taken before the change, and a change lies behind the sample before it.
    for (pair_s, value) in t_s.windows(2).zip(values.iter().skip(1)) {
        // The read-back of a command that is held moves in its last digits.
        let moved = p3_pa.is_nan() || (value / p3_pa - 1.0).abs() > HELD_RATIO;
        if moved && value.is_finite() && pair_s[0] > start_s {
            (start_s, p3_pa) = (pair_s[0], *value);
            levels.push(level(start_s, p3_pa));
        }
    }
    levels
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
pub fn measured_lag_s(table: &Table, recording: &Recording, noise_sigma: f64) -> Option<(f64, f64)> {
    let values = table.column(Channel::P3)?;
    let levels = LaggedCommand::of_recording(recording, 0.0).levels;
    let jumps: Vec<f64> = recording
        .steps
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

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Series, StepKind};

    fn step(start_s: f64, end_s: f64, p3_pa: f64) -> StepMarker {
        let (index, kind) = (0, StepKind::Point);
        StepMarker { index, kind, start_s, end_s, from: None, to: None, p3_pa, valve_opening_ratio: 0.7 }
    }

    /// Samples every half second; the loop speaks at 12 s, seen at 12.5 s.
    fn recording() -> Recording {
        let t_s: Vec<f64> = (0..=40).map(|i| f64::from(i) * 0.5).collect();
        let command = |t: &f64| match *t {
            t if t <= 10.0 => 150e3,
            t if t <= 12.0 => 200e3,
            _ => 201e3,
        };
        let values = t_s.iter().map(command).collect();
        Recording {
            series: [(Channel::P3Command, Series { t_s, values })].into(),
            steps: vec![step(0.0, 10.0, 150e3), step(10.0, 20.0, 200e3)],
            ..Recording::default()
        }
    }

    #[test]
    fn what_a_loop_says_within_a_step_is_a_level_of_its_own() {
        let command = LaggedCommand::of_recording(&recording(), 0.3);
        let levels: Vec<_> = command.levels().iter().map(|level| (level.start_s, level.p3_pa)).collect();
        assert_eq!(levels, [(0.0, 150e3), (10.0, 200e3), (12.0, 201e3)]);
    }
}
