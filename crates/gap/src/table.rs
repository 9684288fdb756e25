//! A recording on one time base, and the blocks of samples that are compared with the model.

use mapper_core::{Channel, Recording, Series};
use std::collections::BTreeMap;

/// All channels at the same times; NaN where a channel has nothing.
#[derive(Debug, Clone)]
pub struct Table {
    /// Times, s, rising.
    pub t_s: Vec<f64>,
    /// Usual distance of two samples, s.
    pub interval_s: f64,
    /// SI values of each channel, as long as `t_s`.
    pub columns: BTreeMap<Channel, Vec<f64>>,
}

/// A distance of samples beyond this many usual ones is a gap.
const GAP_INTERVALS: f64 = 2.5;

impl Table {
    /// Puts the measured channels of a recording on the time base of the shaft speed, or of the first channel.
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
            .map(|(channel, series)| (*channel, on_base(series, &t_s, interval_s)))
            .collect();
        Some(Table { t_s, interval_s, columns })
    }

    /// Values of a channel, if it is there.
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
    let mut steps: Vec<f64> = t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return None;
    }
    Some(*steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn on_base(series: &Series, t_s: &[f64], interval_s: f64) -> Vec<f64> {
    if series.t_s == t_s {
        return series.values.clone();
    }
    // A slower channel has its own distance of samples; what is a gap follows from it.
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

/// A few consecutive samples, compared with the model as their mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The samples.
    pub samples: std::ops::Range<usize>,
    /// Mean of their times, s.
    pub mean_s: f64,
    /// Standard deviation of their times, s: the model's mean is taken from the two points at this distance, which
    /// is exact for cubics in the first two moments.
    pub spread_s: f64,
    /// Mean time since the jump, s.
    pub since_jump_s: f64,
}

/// Length of blocks after a jump: up to so many seconds, blocks of so many seconds.
const LENGTHS_S: [(f64, f64); 6] =
    [(1.0, 0.1), (3.0, 0.2), (6.0, 1.0), (14.0, 2.0), (30.0, 4.0), (f64::INFINITY, LONGEST_S)];
/// Length of blocks where only metal moves, s.
const LONGEST_S: f64 = 10.0;

/// Blocks from `start_s` to `end_s`; fine after the jump at `start_s` when there is one.
pub fn blocks(table: &Table, start_s: f64, end_s: f64, jumped: bool) -> Vec<Block> {
    let mut found = Vec::new();
    let mut at_s = start_s;
    while at_s < end_s - 1e-9 {
        let since_s = at_s - start_s;
        let length_s = if jumped {
            LENGTHS_S.iter().find(|(until_s, _)| since_s < until_s - 1e-9).map_or(LONGEST_S, |(_, l)| *l)
        } else {
            LONGEST_S
        };
        let length_s = length_s.max(table.interval_s);
        // What is left over at the end goes to the last block.
        let next_s = if at_s + 1.5 * length_s >= end_s { end_s } else { at_s + length_s };
        // Half a sample late, so that a sample on an edge falls on the same side whatever its last digit.
        let samples = table.range(at_s + 0.5 * table.interval_s, next_s + 0.5 * table.interval_s);
        if !samples.is_empty() {
            let times = &table.t_s[samples.clone()];
            let count = times.len() as f64;
            let mean_s = times.iter().sum::<f64>() / count;
            let spread_s = (times.iter().map(|t| (t - mean_s) * (t - mean_s)).sum::<f64>() / count).sqrt();
            found.push(Block { samples, mean_s, spread_s, since_jump_s: mean_s - start_s });
        }
        at_s = next_s;
    }
    found
}

/// Mean of a channel in a block; `None` where samples are missing.
pub fn block_mean(values: &[f64], block: &Block) -> Option<f64> {
    let values = &values[block.samples.clone()];
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    mean.is_finite().then_some(mean)
}
