//! Averages over a step, and the state at its start.

use mapper_core::{Channel, Recording, Series};
use mapper_numerics::statistics::{mean, median};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{State, rad_s_of_rpm};
use std::collections::BTreeMap;

/// Distance of the end of a segment before a jump, s: a sample at the jump belongs to the segment after it. Bound: above the rounding of
/// times, below any sample interval.
pub const BEFORE_S: f64 = 1e-6;

/// Mean of readings, in their unit; `None` without any, or if one of them is not a number.
pub fn mean_reading(values: &[f64]) -> Option<f64> {
    mean(values).filter(|mean| mean.is_finite())
}

/// Mean of a channel from `start_s` until just before `end_s`; `None` if it has fewer than `min_samples` samples, or one of them is not a
/// number.
pub fn mean_between(
    recording: &Recording,
    channel: Channel,
    start_s: f64,
    end_s: f64,
    min_samples: usize,
) -> Option<f64> {
    let values = recording.series.get(&channel)?.slice(start_s, end_s - BEFORE_S).1;
    mean_reading(values).filter(|_| values.len() >= min_samples)
}

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

/// Difference of equal times, s. Source: recordings store nanoseconds.
pub(crate) const TIME_ROUNDING_S: f64 = 1e-9;

/// Rule for cutting a step into segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Start of the first segment after that of the step, s.
    pub first_s: f64,
    /// Segment lengths: pairs of an end time, from the start of the step, and the length that applies until then, s. The last length applies
    /// without limit.
    pub lengths_s: &'static [(f64, f64)],
    /// Segments shorter than this are merged with the previous one, s ...
    pub shortest_s: f64,
    /// ... and so are those shorter than this share of their nominal length.
    pub shortest_ratio: f64,
}

impl Schedule {
    /// Starts and ends of the segments from `start_s` to `end_s`, without gaps. Each is at least as long as the sample interval `interval_s`.
    /// The list is empty if the step is shorter than the shortest segment.
    pub fn segments(&self, start_s: f64, end_s: f64, interval_s: f64) -> Vec<(f64, f64)> {
        let whole_s = end_s - start_s;
        let mut segments = Vec::new();
        let mut at_s = self.first_s;
        while whole_s - at_s > TIME_ROUNDING_S {
            let row = self.lengths_s.iter().find(|(until_s, _)| at_s < until_s - TIME_ROUNDING_S);
            let length_s = row.or(self.lengths_s.last()).map_or(whole_s, |(_, l)| *l).max(interval_s);
            let shortest_s = self.shortest_s.max(self.shortest_ratio * length_s);
            if whole_s - at_s < shortest_s {
                break;
            }
            let mut next_s = (at_s + length_s).min(whole_s);
            if whole_s - next_s < shortest_s {
                next_s = whole_s;
            }
            segments.push((start_s + at_s, start_s + next_s));
            at_s = next_s;
        }
        segments
    }
}

/// A few consecutive samples, compared with the model as their mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The samples.
    pub samples: std::ops::Range<usize>,
    /// Mean of their times, s.
    pub mean_s: f64,
    /// Standard deviation of their times, s. The mean of the model is taken from the two points at this distance from `mean_s`, which is
    /// exact for cubics in the first two moments.
    pub spread_s: f64,
    /// Mean time since the jump, s.
    pub since_jump_s: f64,
}

/// Blocks from `start_s` to `end_s` according to the schedule; empty ones are omitted.
pub fn blocks(table: &Table, start_s: f64, end_s: f64, schedule: &Schedule) -> Vec<Block> {
    let segments = schedule.segments(start_s, end_s, table.interval_s);
    let block = |(from_s, to_s): (f64, f64)| {
        // Half a sample later, so that rounding cannot move a sample across an edge.
        let samples = table.range(from_s + 0.5 * table.interval_s, to_s + 0.5 * table.interval_s);
        let times = &table.t_s[samples.clone()];
        let mean_s = mean_reading(times)?;
        let spread_s =
            (times.iter().map(|t| (t - mean_s) * (t - mean_s)).sum::<f64>() / times.len() as f64).sqrt();
        Some(Block { samples, mean_s, spread_s, since_jump_s: mean_s - start_s })
    };
    segments.into_iter().filter_map(block).collect()
}

/// Mean of a channel in a block; `None` if samples are missing.
pub fn block_mean(values: &[f64], block: &Block) -> Option<f64> {
    mean_reading(&values[block.samples.clone()])
}

/// Shaft speed, rpm. Bound: a start value; the steady state does not depend on it.
const USUAL_RPM: f64 = 90e3;
/// Minimum shaft speed, rpm. Bound: the model divides by it.
const MIN_RPM: f64 = 1e3;
/// Pressure ratio. Bound: a start value.
const USUAL_PRESSURE_RATIO: f64 = 1.5;
/// Rise of the compressor housing above the inlet, K. Bound: a start value.
const USUAL_HOUSING_RISE_K: f64 = 40.0;
/// Rise of the gas, K. Bound: a start value.
const USUAL_RISE_K: f64 = 50.0;

/// The state given by readings; `read` returns the mean of a channel. Missing readings are replaced by typical values of a turbocharger under
/// the boundary conditions, which suffice because the steady state does not depend on them.
pub fn estimate_state(boundary: &BoundaryConditions, read: impl Fn(Channel) -> Option<f64>) -> State {
    let read_or = |channel: Channel, usual: f64| read(channel).unwrap_or(usual);
    State::new(
        rad_s_of_rpm(read_or(Channel::ShaftSpeed, USUAL_RPM).max(MIN_RPM)),
        read_or(Channel::P2, USUAL_PRESSURE_RATIO * boundary.p1_pa).max(boundary.p1_pa),
        read_or(Channel::Tc, boundary.t1_k + USUAL_HOUSING_RISE_K),
        read_or(Channel::Tt, 0.5 * (boundary.t3_k + boundary.t1_k)),
        read_or(Channel::T2, boundary.t1_k + USUAL_RISE_K),
    )
}

/// Outputs of the model that a sensor measures. P3 is a boundary condition and is compared only if its lag matters.
pub const OUTPUTS: [Channel; 8] = [
    Channel::ShaftSpeed,
    Channel::P2,
    Channel::CompressorFlow,
    Channel::TurbineFlow,
    Channel::T2,
    Channel::Tc,
    Channel::Tt,
    Channel::T4,
];

/// Recorded boundary conditions that drive the model.
pub const INPUT_CHANNELS: [Channel; 6] =
    [Channel::T1, Channel::P1, Channel::P3, Channel::T3, Channel::P4, Channel::TOil];

/// The boundary condition that a channel measures; `None` for channels that are not inputs.
pub fn boundary_condition(boundary: &mut BoundaryConditions, channel: Channel) -> Option<&mut f64> {
    match channel {
        Channel::T1 => Some(&mut boundary.t1_k),
        Channel::P1 => Some(&mut boundary.p1_pa),
        Channel::P3 => Some(&mut boundary.p3_pa),
        Channel::T3 => Some(&mut boundary.t3_k),
        Channel::P4 => Some(&mut boundary.p4_pa),
        Channel::TOil => Some(&mut boundary.oil_temperature_k),
        Channel::TAmb => Some(&mut boundary.ambient_temperature_k),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: Schedule = Schedule {
        first_s: 5.0,
        lengths_s: &[(15.0, 10.0), (35.0, 20.0), (95.0, 30.0), (f64::INFINITY, 60.0)],
        shortest_s: 5.0,
        shortest_ratio: 0.0,
    };

    #[test]
    fn a_step_of_two_minutes_has_five_segments_without_gaps() {
        let edges = [(105.0, 115.0), (115.0, 135.0), (135.0, 165.0), (165.0, 195.0), (195.0, 220.0)];
        assert_eq!(SLOW.segments(100.0, 220.0, 0.1), edges);
        assert!(SLOW.segments(100.0, 104.0, 0.1).is_empty());
        // Three seconds more than a whole segment belong to it.
        assert_eq!(SLOW.segments(0.0, 38.0, 0.1), [(5.0, 15.0), (15.0, 38.0)]);
    }

    #[test]
    fn no_segment_is_shorter_than_a_sample_or_than_its_share() {
        let fast = Schedule {
            first_s: 0.0,
            lengths_s: &[(1.0, 0.1), (f64::INFINITY, 10.0)],
            shortest_s: 0.0,
            shortest_ratio: 0.5,
        };
        let segments = fast.segments(7.0, 24.0, 0.25);
        assert_eq!(segments.first().map(|s| s.0), Some(7.0));
        assert_eq!(segments.last().map(|s| s.1), Some(24.0));
        assert!(segments.windows(2).all(|pair| pair[0].1 == pair[1].0));
        assert!(segments.iter().all(|(from_s, to_s)| to_s - from_s > 0.24));
    }
}
