//! Watches when the sensors that matter rest during a soak.

use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, SampleBatch, Soak, is_reading};
use std::collections::VecDeque;

/// Length of a mean, s. Bound: noise of 0.1 K averages to 0.02 K.
const BLOCK_S: f64 = 30.0;
/// Number of compared means. Bound: two and a half minutes, which the zero uses after the shortest soak.
const BLOCKS: usize = 5;
/// Sensors whose rest ends a soak: a housing takes an hour, and its offset is declared.
const WATCHED: [Channel; 2] = [Channel::T1, Channel::T2];

/// Means of the watched sensors during a soak.
#[derive(Debug, Default)]
pub(crate) struct RestWatch {
    /// End of the current block, s; `None` before the first sample.
    block_end_s: Option<f64>,
    /// Sums and counts of the current block.
    sums: [(f64, usize); WATCHED.len()],
    /// The last means.
    means: VecDeque<[f64; WATCHED.len()]>,
}

impl RestWatch {
    /// Receives the samples of the soak.
    pub(crate) fn on_batch(&mut self, batch: &SampleBatch) {
        let columns = WATCHED.map(|channel| batch.columns.iter().find(|column| column.channel == channel));
        for (index, t_s) in batch.t_s.iter().enumerate() {
            let end_s = *self.block_end_s.get_or_insert(t_s + BLOCK_S);
            if *t_s >= end_s {
                self.end_block();
                self.block_end_s = Some(t_s + BLOCK_S);
            }
            for ((sum, count), (column, channel)) in self.sums.iter_mut().zip(columns.iter().zip(WATCHED)) {
                let value = column.and_then(|column| column.values.get(index)).copied();
                if let Some(value) = value.filter(|value| is_reading(channel, *value)) {
                    *sum += value;
                    *count += 1;
                }
            }
        }
    }

    fn end_block(&mut self) {
        self.means.push_back(self.sums.map(|(sum, count)| sum / count as f64));
        self.sums = Default::default();
        if self.means.len() > BLOCKS {
            self.means.pop_front();
        }
    }

    /// Whether each watched sensor drifts by less than what the zero accepts. A sensor without readings never rests.
    pub(crate) fn is_at_rest(&self) -> bool {
        let means: Vec<_> = self.means.iter().copied().collect();
        let [first, second, .., before_last, last] = means.as_slice() else { return false };
        let apart_min = (BLOCKS - 2) as f64 * BLOCK_S / S_PER_MIN;
        means.len() == BLOCKS
            && (0..WATCHED.len()).all(|i| {
                let drift_k = 0.5 * (last[i] + before_last[i] - first[i] - second[i]);
                (drift_k / apart_min).abs() <= Soak::MAX_DRIFT_K_MIN
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    /// T2 that approaches 298 K with a time constant of two minutes from 5 K above drifts by 0.1 K/min after two minutes times ln(25), 6.4 min; the
    /// middle of the compared means is reached later.
    #[test]
    fn a_probe_that_cools_rests_when_its_drift_is_small() {
        let mut watch = RestWatch::default();
        let mut rested_s = None;
        for second in 0..1200 {
            let t_s: Vec<f64> = (0..10).map(|i| f64::from(second) + 0.1 * f64::from(i)).collect();
            let column = |channel, values| ChannelColumn { channel, values };
            let t2 = t_s.iter().map(|t| 298.0 + 5.0 * (-t / 120.0).exp()).collect();
            watch.on_batch(&SampleBatch {
                columns: vec![column(Channel::T1, vec![298.0; 10]), column(Channel::T2, t2)],
                t_s,
                ..SampleBatch::default()
            });
            if watch.is_at_rest() && rested_s.is_none() {
                rested_s = Some(second);
            }
        }
        assert!((400..560).contains(&rested_s.unwrap()), "{rested_s:?}");
        // Without readings of T2 nothing is known.
        let mut blind = RestWatch::default();
        for second in 0..600 {
            let column = ChannelColumn { channel: Channel::T1, values: vec![298.0] };
            blind.on_batch(&SampleBatch {
                t_s: vec![f64::from(second)],
                columns: vec![column],
                ..SampleBatch::default()
            });
        }
        assert!(!blind.is_at_rest());
    }
}
