//! Limits of a diagnosis: missing, late and lost data, and offsets at rest.

use mapper_core::{Channel, coded_enum};
use serde::Serialize;

coded_enum! {
/// A limit of a diagnosis, by its stable code.
GapWarning {
    /// Effects that show only in this channel cannot be found.
    "channel_not_recorded" ChannelNotRecorded { channel: Channel },
    /// The campaign's value replaces the readings of an input.
    "input_not_recorded" InputNotRecorded { channel: Channel },
    /// Blocks without samples are omitted.
    "gaps_in_recording" GapsInRecording { gaps: usize, missing_s: f64 },
    /// The noise of a typical sensor is used, in the unit of the channel.
    "assumed_noise" AssumedNoise { channel: Channel, noise_sigma: f64 },
    /// The sample times scatter, so changing readings have less weight.
    "uncertain_times" UncertainTimes { scatter_s: f64 },
    /// A limit of the baseline recording.
    "baseline_recording" BaselineRecording { warning: Box<GapWarning> },
    /// A drift during the recording: `subtracted` from a sensor's readings, or of the machine, so that no cause is named.
    "drift" Drift { reason: String, subtracted: bool },
    /// A detected drift was not subtracted, because tolerances alone explain the recording down to noise.
    "drift_not_subtracted" DriftNotSubtracted { reason: String },
    /// Only parts of a recording are readable.
    "recording_incomplete" RecordingIncomplete { reason: String },
}
}

/// Offset of a sensor at rest beyond its declaration, in the unit of the channel; subtracted before the diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OffsetAtRest {
    /// The channel.
    pub channel: Channel,
    /// Offset found at rest.
    pub offset: f64,
    /// Declared standard deviation of the offset.
    pub declared_sigma: f64,
}
