//! Whether a point has settled, seen in the samples alone.

use crate::bench::SettleBands;
use mapper_core::{Channel, SampleBatch};
use std::collections::VecDeque;

/// Samples over which drifts are judged, s.
const SPAN_S: f64 = 30.0;
/// Most samples that are kept; a rig that is faster is looked at over a shorter span.
const SAMPLE_LIMIT: usize = 100_000;

/// When a step that waits may end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettleRule {
    /// Largest drift of T2 and Tc over the last 30 s, K/s.
    pub rate_max_k_s: f64,
    /// Largest relative changes of speed, flow and pressure ratio over the last 30 s.
    pub bands: SettleBands,
}

/// Watches the samples of one step.
///
/// Settled: over the last 30 s the slopes of T2 and Tc (least squares) are within the rate, and speed, flow and
/// pressure ratio (means of the first and the last third) within their bands. Channels that a rig lacks do not count;
/// without T2 nothing settles.
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
    /// A watch over a step that starts at `start_s` of the run.
    pub fn new(rule: SettleRule, start_s: f64) -> Self {
        SettleWatch { rule, start_s, samples: VecDeque::new() }
    }

    /// Takes the next samples; true when the point has settled.
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
            || self.samples.front().is_some_and(|row| row[0] < now_s - SPAN_S)
        {
            self.samples.pop_front();
        }
        if now_s - self.start_s < SPAN_S || self.samples.len() < 3 {
            return false;
        }
        let slow = |column: usize| self.slope(column).map(|slope| slope.abs() <= self.rule.rate_max_k_s);
        let bands = &self.rule.bands;
        let still = |value: fn(&[f64; COLUMNS]) -> f64, ratio: f64| {
            self.change_ratio(value).is_none_or(|change| change <= ratio)
        };
        slow(1) == Some(true)
            && slow(2) != Some(false)
            && still(|row| row[3], bands.speed_ratio)
            && still(|row| row[4], bands.flow_ratio)
            && still(|row| row[6] / row[5], bands.pressure_ratio_ratio)
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

    /// Relative difference of the means over the first and the last third; `None` where either has no sample.
    fn change_ratio(&self, value: fn(&[f64; COLUMNS]) -> f64) -> Option<f64> {
        let third = self.samples.len() / 3;
        let mean = |rows: &mut dyn Iterator<Item = &[f64; COLUMNS]>| {
            let (sum, count) =
                rows.map(value).filter(|v| v.is_finite()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            (count > 0.0).then(|| sum / count)
        };
        let first = mean(&mut self.samples.iter().take(third))?;
        let last = mean(&mut self.samples.iter().rev().take(third))?;
        Some(((last - first) / last).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    const RULE: SettleRule = SettleRule {
        rate_max_k_s: 1.0 / 60.0,
        bands: SettleBands { speed_ratio: 0.008, flow_ratio: 0.015, pressure_ratio_ratio: 0.02 },
    };

    fn batch(start_s: f64, t2: impl Fn(f64) -> f64) -> SampleBatch {
        let t_s: Vec<f64> = (0..10).map(|i| start_s + 0.1 * f64::from(i)).collect();
        let values = t_s.iter().map(|t| t2(*t)).collect();
        SampleBatch {
            columns: vec![ChannelColumn { channel: Channel::T2, values }],
            t_s,
            ..SampleBatch::default()
        }
    }

    /// A step response of 10 K with 60 s settles to 1 K/min where 10/60 exp(-t/60) = 1/60, at 138 s; seen over the
    /// last 30 s it comes a few seconds to half a span later.
    #[test]
    fn an_exponential_settles_when_its_slope_says_so() {
        let mut watch = SettleWatch::new(RULE, 0.0);
        let settled = (0..600).find(|second| {
            watch.has_settled(&batch(f64::from(*second), |t| 400.0 - 10.0 * (-t / 60.0).exp()))
        });
        let settled = settled.unwrap();
        assert!((138..=155).contains(&settled), "{settled}");
    }

    #[test]
    fn nothing_settles_within_the_span_or_without_t2() {
        let mut watch = SettleWatch::new(RULE, 0.0);
        assert!(!(0..29).any(|second| watch.has_settled(&batch(f64::from(second), |_| 400.0))));
        let mut watch = SettleWatch::new(RULE, 0.0);
        assert!(!(0..90).any(|second| watch.has_settled(&batch(f64::from(second), |_| f64::NAN))));
    }
}
