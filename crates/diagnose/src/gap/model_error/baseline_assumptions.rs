//! Baseline of a rig taken from a reference recording, machine-readable.

use serde::Serialize;
use std::collections::BTreeMap;

/// Baseline of a rig: its model error in fault-free condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Since {
    /// The reference recording.
    pub recording: String,
    /// Model error of each channel there after fitting tolerances; present in both recordings and therefore not diagnosed.
    pub lacking: BTreeMap<String, Lacking>,
}

/// Model error of one channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lacking {
    /// Root mean square, in the channel's unit.
    pub size: f64,
    /// Unit.
    pub unit: String,
    /// Relative model error of the channel's changes over the recording, 0..1; changes since then may be predicted equally badly.
    pub share: f64,
}
