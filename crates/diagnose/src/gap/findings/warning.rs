//! What limits a diagnosis: missing, late and lost data, and offsets at rest.

use mapper_core::{Channel, coded_enum};
use serde::Serialize;

coded_enum! {
/// A limit of a diagnosis, by its stable code.
GapWarning {
    /// Effects that show only in this channel cannot be found.
    "channel_not_recorded" ChannelNotRecorded { channel: Channel },
    /// The campaign's value replaces the readings of an input.
    "input_not_recorded" InputNotRecorded { channel: Channel },
    /// Blocks without samples are left out.
    "gaps_in_recording" GapsInRecording { gaps: usize, missing_s: f64 },
    /// The noise of a typical sensor is used, in the unit of the channel.
    "assumed_noise" AssumedNoise { channel: Channel, noise_sigma: f64 },
    /// The times of the samples scatter, so that readings that move count less.
    "uncertain_times" UncertainTimes { scatter_s: f64 },
    /// A limit of the healthy recording.
    "healthy_recording" HealthyRecording { warning: Box<GapWarning> },
    /// Something drifted while the recording was made: `subtracted` from a sensor's readings, or the machine, so that no cause is named.
    "drift" Drift { reason: String, subtracted: bool },
    /// A drift was found and not subtracted: without it nothing but noise is left.
    "drift_not_subtracted" DriftNotSubtracted { reason: String },
    /// A recording could be read in parts only.
    "recording_incomplete" RecordingIncomplete { reason: String },
}
}

/// What a sensor read too much at rest, beyond its declaration; subtracted before the diagnosis. In the unit of the channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OffsetAtRest {
    /// The channel.
    pub channel: Channel,
    /// Offset found at rest.
    pub offset: f64,
    /// Declared standard deviation of the offset.
    pub declared_sigma: f64,
}
