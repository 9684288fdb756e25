//! A recording on one time base.

use mapper_core::{Channel, Recording, Series};
use mapper_numerics::statistics::median;
use std::collections::BTreeMap;

/// All channels at the same times; NaN for missing values.
#[derive(Debug, Clone)]
pub struct Table {
    /// Times, s, rising.
    pub t_s: Vec<f64>,
    /// Typical sample interval, s.
    pub interval_s: f64,
    /// SI values of each channel, as long as `t_s`.
    pub columns: BTreeMap<Channel, Vec<f64>>,
}

/// A sample interval above this many typical ones is a gap. Bound: one lost sample doubles an interval, and clocks jitter by less than
/// half.
pub const GAP_INTERVALS: f64 = 2.5;

impl Table {
    /// Resamples the measured channels of a recording to the times of the shaft speed, or of the first channel.
    pub fn new(recording: &Recording) -> Option<Table> {
        let measured = |channel: &Channel| channel.info().group != mapper_core::Group::Command;
        let base = recording
            .series
            .get(&Channel::ShaftSpeed)
            .or_else(|| recording.series.iter().find(|(channel, _)| measured(channel)).map(|(_, s)| s))?;
        let t_s = base.t_s.clone();
        let interval_s = median_interval_s(&t_s)?;
        let columns = recording
            .series
            .iter()
            .filter(|(channel, series)| measured(channel) && series.t_s.len() > 1)
            .map(|(channel, series)| (*channel, resample(series, &t_s, interval_s)))
            .collect();
        Some(Table { t_s, interval_s, columns })
    }

    /// Values of a channel, if present.
    pub fn column(&self, channel: Channel) -> Option<&[f64]> {
        self.columns.get(&channel).map(Vec::as_slice)
    }

    /// Indices of the samples with `start_s <= t < end_s`.
    pub fn range(&self, start_s: f64, end_s: f64) -> std::ops::Range<usize> {
        let start = self.t_s.partition_point(|t| *t < start_s);
        start..self.t_s.partition_point(|t| *t < end_s).max(start)
    }
}

fn median_interval_s(t_s: &[f64]) -> Option<f64> {
    median(t_s.windows(2).map(|pair| pair[1] - pair[0]))
}

/// The values of a series at the times `t_s`, with the typical interval `interval_s`; NaN in gaps.
pub(crate) fn resample(series: &Series, t_s: &[f64], interval_s: f64) -> Vec<f64> {
    if series.t_s == t_s {
        return series.values.clone();
    }
    // A slower channel has its own sample interval, which determines its gaps.
    let gap_s = GAP_INTERVALS * median_interval_s(&series.t_s).unwrap_or(interval_s).max(interval_s);
    t_s.iter()
        .map(|t| {
            let after = series.t_s.partition_point(|s| s < t);
            let near = |i: usize| series.t_s.get(i).is_some_and(|s| (s - t).abs() <= gap_s);
            let exact = series.t_s.get(after).is_some_and(|s| s == t);
            if exact {
                series.values[after]
            } else if after > 0 && near(after - 1) && near(after) {
                series.interpolate(*t).unwrap_or(f64::NAN)
            } else {
                f64::NAN
            }
        })
        .collect()
}
