//! Samples of one channel in the order of the file, and the series made of them.

use crate::ReadWarning;
use crate::log_clock::STRAY_S;
use mapper_core::{Channel, Series};

/// Collects the samples of one channel.
#[derive(Debug, Default)]
pub(crate) struct SeriesBuilder {
    times_ns: Vec<u64>,
    values: Vec<f64>,
    pub(crate) not_numbers: u64,
}

impl SeriesBuilder {
    pub(crate) fn push(&mut self, time_ns: u64, value: f64) {
        self.times_ns.push(time_ns);
        self.values.push(value);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.times_ns.is_empty()
    }

    pub(crate) fn first_time_ns(&self) -> Option<u64> {
        self.times_ns.iter().copied().min()
    }

    /// Removes samples that are more than a day from both neighbours in time; returns their number and the first such time.
    pub(crate) fn drop_strays(&mut self) -> Option<(u64, u64)> {
        let mut sorted = self.times_ns.clone();
        sorted.sort_unstable();
        let far = |a: u64, b: u64| a.abs_diff(b) as f64 > STRAY_S * 1e9;
        let strays: Vec<u64> = sorted
            .iter()
            .enumerate()
            .filter(|(at, time_ns)| {
                let before = at.checked_sub(1).and_then(|before| sorted.get(before));
                let after = sorted.get(at + 1);
                sorted.len() > 2
                    && [before, after].into_iter().flatten().all(|neighbour| far(*neighbour, **time_ns))
            })
            .map(|(_, time_ns)| *time_ns)
            .collect();
        // If most samples are that far apart, this is the channel's sampling interval.
        let first = *strays.first().filter(|_| 2 * strays.len() < sorted.len())?;
        let kept =
            self.times_ns.iter().zip(&self.values).filter(|(time, _)| strays.binary_search(time).is_err());
        (self.times_ns, self.values) = kept.map(|(time_ns, value)| (*time_ns, *value)).unzip();
        Some((strays.len() as u64, first))
    }

    /// The series over run time, strictly increasing; of samples at the same time the first one is kept.
    pub(crate) fn build(self, channel: Channel, zero_ns: u64, warnings: &mut Vec<ReadWarning>) -> Series {
        if self.not_numbers > 0 {
            warnings.push(ReadWarning::NotANumber { channel, count: self.not_numbers });
        }
        let (times_ns, values) = if self.times_ns.is_sorted_by(|a, b| a < b) {
            (self.times_ns, self.values)
        } else {
            let reordered = self.times_ns.windows(2).filter(|pair| pair[1] < pair[0]).count();
            let mut samples: Vec<(u64, f64)> = self.times_ns.into_iter().zip(self.values).collect();
            let before = samples.len();
            samples.sort_by_key(|(time_ns, _)| *time_ns);
            samples.dedup_by_key(|(time_ns, _)| *time_ns);
            let repeated = before - samples.len();
            warnings.push(ReadWarning::OutOfOrder { channel, reordered, repeated });
            samples.into_iter().unzip()
        };
        Series { t_s: times_ns.into_iter().map(|time_ns| run_time_s(time_ns, zero_ns)).collect(), values }
    }
}

/// Run time of a log time. Exact to the nanosecond for runs up to 104 days.
pub(crate) fn run_time_s(time_ns: u64, zero_ns: u64) -> f64 {
    (time_ns as i128 - zero_ns as i128) as f64 / 1e9
}
