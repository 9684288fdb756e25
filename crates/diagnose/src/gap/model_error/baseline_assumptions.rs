//! Baseline of a rig taken from a reference recording, machine-readable.

use serde::Serialize;
use std::collections::BTreeMap;

/// Baseline of a rig: its model error in fault-free condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baseline {
    /// The reference recording.
    pub recording: String,
    /// Model error of each channel there after fitting tolerances; present in both recordings and therefore not diagnosed.
    pub lacking: BTreeMap<String, Lacking>,
}

/// Errors of the model's equations, as a campaign declares them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Declaration {
    /// `offset` of the sensor, in the channel's unit: the mean error of the equations, if it is larger than the declared offset.
    pub offset: Option<f64>,
    /// `tolerances: structure`: standard deviation of the error, relative to that of the readings.
    pub structure_ratio: f64,
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
    /// What the campaign declares for a diagnosis of this rig without a reference.
    pub declare: Declaration,
}
