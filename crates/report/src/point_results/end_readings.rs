//! Readings at the end of steps, when the gas is settled and the housing is not.

use mapper_core::{Channel, Recording, StepMarker};
use mapper_numerics::statistics::mean;

/// The last seconds of a step, over which readings are averaged.
pub const END_S: f64 = 2.0;

/// The mean of a channel over the last seconds of a step, in the channel's unit; `None` without readings.
pub fn at_end(recording: &Recording, marker: &StepMarker, channel: Channel) -> Option<f64> {
    let start_s = (marker.end_s - END_S).max(marker.start_s);
    let values = recording.series.get(&channel)?.slice(start_s, marker.end_s).1;
    mean(values).filter(|mean| mean.is_finite())
}
