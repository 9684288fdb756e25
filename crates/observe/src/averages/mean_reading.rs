//! Mean readings.

use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::mean;

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
