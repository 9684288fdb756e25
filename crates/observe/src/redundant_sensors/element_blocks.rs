//! Means of redundant sensors over common short blocks, independent of their sampling.

use mapper_core::{Channel, Series, is_reading};

/// Length of a block, s. Bound: longer than the correlation time of usual noise, shorter than the lag of a probe that is too large.
const BLOCK_S: f64 = 2.0;
/// Maximum number of blocks of a recording; a longer one has longer blocks. Bound: effort; two days.
const MAX_BLOCKS: f64 = 100_000.0;

/// Block means of each sensor; NaN without a reading.
#[derive(Debug, Clone)]
pub(crate) struct Blocks {
    pub(crate) start_s: f64,
    pub(crate) length_s: f64,
    /// Block means of each sensor.
    pub(crate) means: Vec<Vec<f64>>,
    /// Typical number of samples in a block of each sensor.
    pub(crate) samples: Vec<usize>,
}

impl Blocks {
    /// The blocks of these sensors of a channel; `None` if none of them has a reading.
    pub(crate) fn new(channel: Channel, sensors: &[Option<&Series>]) -> Option<Blocks> {
        let all = || sensors.iter().flatten();
        let start_s = all().filter_map(|series| series.t_s.first().copied()).reduce(f64::min)?;
        let end_s = all().filter_map(|series| series.t_s.last().copied()).reduce(f64::max)?;
        let span_s = (end_s - start_s).max(0.0);
        if !span_s.is_finite() {
            return None;
        }
        let length_s = BLOCK_S.max(span_s / MAX_BLOCKS);
        let block_count = (span_s / length_s) as usize + 1;
        let (mut means, mut samples) = (Vec::new(), Vec::new());
        for series in sensors {
            let mut sums = vec![(0.0, 0usize); block_count];
            for (t_s, value) in series.iter().flat_map(|series| series.t_s.iter().zip(&series.values)) {
                let block = sums.get_mut(((t_s - start_s) / length_s) as usize);
                if let Some((sum, count)) = block.filter(|_| is_reading(channel, *value)) {
                    (*sum, *count) = (*sum + value, *count + 1);
                }
            }
            let all: usize = sums.iter().map(|(_, count)| count).sum();
            let filled = sums.iter().filter(|(_, count)| *count > 0).count().max(1);
            samples.push(all / filled);
            means.push(sums.into_iter().map(|(sum, count)| sum / count as f64).collect());
        }
        Some(Blocks { start_s, length_s, means, samples })
    }

    /// Number of blocks.
    pub(crate) fn count(&self) -> usize {
        self.means.first().map_or(0, Vec::len)
    }

    /// The weighted mean of the sensors in each block; NaN if one of them is missing.
    pub(crate) fn weighted(&self, weights: &[f64]) -> Vec<f64> {
        let at = |block: usize| {
            let used = weights.iter().zip(&self.means).filter(|(weight, _)| **weight > 0.0);
            used.map(|(weight, means)| weight * means[block]).sum()
        };
        (0..self.count()).map(at).collect()
    }

    /// Rate of change of a sensor's reading at each block, in its unit per second; NaN at both ends and next to gaps.
    pub(crate) fn slope_s(&self, sensor: usize) -> Vec<f64> {
        let means = &self.means[sensor];
        let at = |block: usize| match (block.checked_sub(1), means.get(block + 1)) {
            (Some(before), Some(after)) => (after - means[before]) / (2.0 * self.length_s),
            _ => f64::NAN,
        };
        (0..means.len()).map(at).collect()
    }
}
