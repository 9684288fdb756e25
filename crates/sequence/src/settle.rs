//! A step that a script asks for, its result, and whether its point has settled, decided from the samples alone.

use crate::error::ScriptError;
use mapper_core::{
    Channel, IdentifiedPoint, OperatingPoint, PlanStep, SampleBatch, SettleBands, Soak, Verdict,
};
use mapper_numerics::statistics::median;
use mapper_physics::operating_point::settled::{BLOCK_S, noise_spread, settled_count, with_bands};
use std::collections::{BTreeMap, VecDeque};

/// End condition of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EndCondition {
    /// After the step's duration.
    Dwell,
    /// As soon as the point has settled, at the latest after the step's duration.
    UntilSettled(SettleRule),
}

/// A step requested by a script, checked against the campaign's limits.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceStep {
    /// The step; its `dwell_s` is its maximum duration.
    pub step: PlanStep,
    /// Condition for an earlier end.
    pub end: EndCondition,
    /// Standstill before the step; with a non-uniformity if it is a zero.
    pub rest: Option<Soak>,
}

/// A message from the script's thread, with the notes since the last one.
#[derive(Debug)]
pub(crate) enum ScriptMessage {
    Step(Box<SequenceStep>, Vec<String>),
    Done(Vec<String>),
    Failed(Box<ScriptError>, Vec<String>),
}

/// A finished step, as the script receives it.
#[derive(Debug, Clone, PartialEq)]
pub struct StepResult {
    /// Number of the step, from 1, as tables print it.
    pub number: usize,
    /// Target.
    pub target: OperatingPoint,
    /// Origin; `None` for the first step.
    pub from: Option<OperatingPoint>,
    /// Start, run time, s.
    pub start_s: f64,
    /// End, run time, s.
    pub end_s: f64,
    /// The identified point; `None` if its position on the map is not known.
    pub identified: Option<IdentifiedPoint>,
    /// Mean and variance of each recorded channel over the second half of the step, in its unit.
    pub readings: BTreeMap<Channel, (f64, f64)>,
}

impl StepResult {
    fn identified<T>(&self, value: impl FnOnce(&IdentifiedPoint) -> Option<T>) -> Option<T> {
        self.identified.as_ref().and_then(value)
    }

    /// Efficiency, fraction; `None` if no usable value exists.
    pub fn eta(&self) -> Option<f64> {
        self.identified(|point| point.eta).filter(|_| self.verdict() != "unusable")
    }

    /// Standard error of the efficiency, fraction; infinite if unknown.
    pub fn sigma_eta(&self) -> f64 {
        let known = self.eta().and_then(|_| self.identified(|point| point.eta_uncertainty));
        known.map_or(f64::INFINITY, |uncertainty| uncertainty.combined_standard_error())
    }

    /// Heat-transfer coefficient, W/(m2 K).
    pub fn h_w_m2k(&self) -> Option<f64> {
        self.identified(|point| point.h_w_m2k).filter(|_| self.verdict() != "unusable")
    }

    /// Standard error of the heat-transfer coefficient, W/(m2 K); infinite if unknown.
    pub fn sigma_h_w_m2k(&self) -> f64 {
        let known = self.h_w_m2k().and_then(|_| self.identified(|point| point.h_uncertainty));
        known.map_or(f64::INFINITY, |uncertainty| uncertainty.combined_standard_error())
    }

    /// `good`, `doubtful` or `unusable`; also `unusable` without a point.
    pub fn verdict(&self) -> &'static str {
        match self.identified.as_ref().map(|point| point.verdict) {
            Some(Verdict::Good) => "good",
            Some(Verdict::Doubtful) => "doubtful",
            Some(Verdict::Unusable) | None => "unusable",
        }
    }
}

/// Time over which drifts are judged, s.
const WINDOW_S: f64 = 30.0;
/// Maximum number of stored samples; a rig with a higher sampling rate is judged over a shorter time.
const SAMPLE_LIMIT: usize = 100_000;

/// Condition for the end of a step that waits until it has settled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettleRule {
    /// Largest drift of T2 and Tc over the last 30 s, K/s.
    pub rate_max_k_s: f64,
    /// Largest variations of speed, flow and pressure ratio over the last 30 s.
    pub bands: SettleBands,
}

/// Watches the samples of one step.
///
/// A point has settled if its operating point has settled ([`mapper_physics::operating_point::settled`]) for the last 30 s, and if the least-squares
/// slopes of T2 and Tc over this time are within the rate. Channels that a rig does not measure are ignored, except T2: without T2
/// no point settles.
#[derive(Debug, Clone)]
pub struct SettleWatch {
    rule: SettleRule,
    start_s: f64,
    samples: VecDeque<[f64; COLUMNS]>,
}

const COLUMNS: usize = 7;
const CHANNELS: [Channel; COLUMNS - 1] =
    [Channel::T2, Channel::Tc, Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::P2];

impl SettleWatch {
    /// Creates a watch for a step that starts at `start_s` of the run.
    pub fn new(rule: SettleRule, start_s: f64) -> Self {
        SettleWatch { rule, start_s, samples: VecDeque::new() }
    }

    /// Adds the next samples; returns whether the point has settled.
    pub fn has_settled(&mut self, batch: &SampleBatch) -> bool {
        let columns = CHANNELS.map(|channel| batch.column(channel));
        for (index, t_s) in batch.t_s.iter().enumerate().filter(|(_, t_s)| **t_s >= self.start_s) {
            let mut row = [*t_s; COLUMNS];
            for (value, column) in row.iter_mut().skip(1).zip(columns) {
                *value = column.and_then(|values| values.get(index).copied()).unwrap_or(f64::NAN);
            }
            self.samples.push_back(row);
        }
        let Some(now_s) = self.samples.back().map(|row| row[0]) else { return false };
        while self.samples.len() > SAMPLE_LIMIT
            || self.samples.front().is_some_and(|row| row[0] < now_s - WINDOW_S)
        {
            self.samples.pop_front();
        }
        if now_s - self.start_s < WINDOW_S || self.samples.len() < 3 {
            return false;
        }
        let slow = |column: usize| self.slope(column).map(|slope| slope.abs() <= self.rule.rate_max_k_s);
        slow(1) == Some(true) && slow(2) != Some(false) && self.is_operating_point_settled(now_s)
    }

    /// Whether speed, flow and pressure ratio have settled at the start of the span.
    fn is_operating_point_settled(&self, now_s: f64) -> bool {
        type Signal = fn(&[f64; COLUMNS]) -> f64;
        let signals =
            with_bands::<Signal>(|row| row[3], |row| row[4], |row| row[6] / row[5], &self.rule.bands);
        signals.into_iter().all(|(_, signal, allowed_ratio)| {
            let backwards = self.block_medians(now_s, signal);
            let known = backwards.iter().any(|value| value.is_finite());
            let spread = noise_spread(&backwards);
            let count = backwards.len();
            !known || settled_count(backwards, allowed_ratio, spread) == count
        })
    }

    /// Medians over blocks counted backwards from `now_s`; NaN for blocks without a value.
    fn block_medians(&self, now_s: f64, signal: fn(&[f64; COLUMNS]) -> f64) -> Vec<f64> {
        let count = (WINDOW_S / BLOCK_S) as usize;
        let mut blocks: Vec<Vec<f64>> = vec![Vec::new(); count];
        for row in &self.samples {
            let block = (((now_s - row[0]) / BLOCK_S) as usize).min(count - 1);
            let value = signal(row);
            if value.is_finite() {
                blocks[block].push(value);
            }
        }
        blocks.iter().map(|values| median(values).unwrap_or(f64::NAN)).collect()
    }

    /// Least-squares slope of a column, 1/s; `None` without two usable samples.
    fn slope(&self, column: usize) -> Option<f64> {
        let usable = || self.samples.iter().map(|row| (row[0], row[column])).filter(|(_, v)| v.is_finite());
        let count = usable().count() as f64;
        let (mean_t, mean_v) = usable().fold((0.0, 0.0), |(t, v), (a, b)| (t + a / count, v + b / count));
        let (top, bottom) = usable().fold((0.0, 0.0), |(top, bottom), (t, v)| {
            (top + (t - mean_t) * (v - mean_v), bottom + (t - mean_t) * (t - mean_t))
        });
        (bottom > 0.0).then(|| top / bottom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    fn new_watch() -> SettleWatch {
        SettleWatch::new(SettleRule { rate_max_k_s: 1.0 / 60.0, bands: SettleBands::default() }, 0.0)
    }

    fn batch(start_s: f64, t2: impl Fn(f64) -> f64) -> SampleBatch {
        let t_s: Vec<f64> = (0..10).map(|i| start_s + 0.1 * f64::from(i)).collect();
        let values = t_s.iter().map(|t| t2(*t)).collect();
        SampleBatch {
            columns: vec![ChannelColumn { channel: Channel::T2, values }],
            t_s,
            ..SampleBatch::default()
        }
    }

    /// A step response of 10 K with 60 s settles to 1 K/min when 10/60 exp(-t/60) = 1/60, at 138 s. Judged over the last 30 s,
    /// it settles between a few seconds and half this time later.
    #[test]
    fn an_exponential_settles_when_its_slope_is_small_enough() {
        let mut watch = new_watch();
        let settled = (0..600).find(|second| {
            watch.has_settled(&batch(f64::from(*second), |t| 400.0 - 10.0 * (-t / 60.0).exp()))
        });
        let settled = settled.unwrap();
        assert!((138..=155).contains(&settled), "{settled}");
    }

    #[test]
    fn nothing_settles_within_the_span_or_without_t2() {
        let mut watch = new_watch();
        assert!(!(0..29).any(|second| watch.has_settled(&batch(f64::from(second), |_| 400.0))));
        let mut watch = new_watch();
        assert!(!(0..90).any(|second| watch.has_settled(&batch(f64::from(second), |_| f64::NAN))));
    }

    /// Speed that falls by 0.04 % each second varies by 1.2 % over 30 s, within 1.5 %; by 0.06 %, it varies by 1.8 %.
    #[test]
    fn speed_has_settled_when_it_varies_within_its_band() {
        for (ratio_per_s, expected) in [(4e-4, true), (6e-4, false)] {
            let mut watch = new_watch();
            let settled = (0..60).any(|second| {
                let mut batch = batch(f64::from(second), |_| 400.0);
                let values = batch.t_s.iter().map(|t_s| 1e5 * (1.0 - ratio_per_s * t_s)).collect();
                batch.columns.push(ChannelColumn { channel: Channel::ShaftSpeed, values });
                watch.has_settled(&batch)
            });
            assert_eq!(settled, expected, "{ratio_per_s}");
        }
    }
}
