//! What was taken for granted of a rig, as machines read it.

use serde::Serialize;
use std::collections::BTreeMap;

/// What was taken for granted of a rig: what it was like while it was healthy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Since {
    /// The healthy recording.
    pub recording: String,
    /// For each channel what the model lacked there with its tolerances fitted: in both recordings, and not judged.
    pub lacking: BTreeMap<String, Lacking>,
}

/// What a model lacks of one channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lacking {
    /// Root mean square, in the channel's unit.
    pub size: f64,
    /// Unit.
    pub unit: String,
    /// Share by which the model misses what the channel does over the recording, 0..1: it may miss as much of what changed since.
    pub share: f64,
}
