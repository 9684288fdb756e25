//! A recording in memory: series per channel, steps, events. Truth is not part of it.

use crate::{Channel, Element, Event, Quality, StepMarker};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One channel over time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Series {
    /// Times since the start of the recording, s, strictly increasing.
    pub t_s: Vec<f64>,
    /// SI values, as long as `t_s`.
    pub values: Vec<f64>,
}

impl Series {
    /// Value at `t_s` by linear interpolation, constant beyond both ends. `None` for an empty series.
    pub fn interpolate(&self, t_s: f64) -> Option<f64> {
        let after = self.t_s.partition_point(|t| *t < t_s);
        match (after.checked_sub(1), self.t_s.get(after)) {
            (_, None) => self.values.last().copied(),
            (None, Some(_)) => self.values.first().copied(),
            (Some(before), Some(t_after_s)) => {
                let (t0, v0, v1) = (self.t_s[before], self.values[before], self.values[after]);
                Some(v0 + (v1 - v0) * (t_s - t0) / (t_after_s - t0))
            }
        }
    }

    /// Value of a command at `t_s`: that of the last change at or before `t_s`, or the first one.
    pub fn held(&self, t_s: f64) -> Option<f64> {
        let after = self.t_s.partition_point(|t| *t <= t_s);
        self.values.get(after.saturating_sub(1)).copied()
    }

    /// Indices of the samples with `start_s <= t <= end_s`.
    pub fn range(&self, start_s: f64, end_s: f64) -> std::ops::Range<usize> {
        let start = self.t_s.partition_point(|t| *t < start_s);
        let end = self.t_s.partition_point(|t| *t <= end_s);
        start..end.max(start)
    }

    /// Times and values with `start_s <= t <= end_s`.
    pub fn slice(&self, start_s: f64, end_s: f64) -> (&[f64], &[f64]) {
        let range = self.range(start_s, end_s);
        (&self.t_s[range.clone()], &self.values[range])
    }
}

/// Unusual provenance of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReadingOrigin {
    /// Arrival time, s: the time of its sample.
    pub t_s: f64,
    /// Source time, s; `None`: the arrival time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_t_s: Option<f64>,
    /// Quality reported by the rig.
    pub quality: Quality,
}

/// All recorded data of a run, in SI units.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Recording {
    /// Measured and commanded channels.
    pub series: BTreeMap<Channel, Series>,
    /// Each sensor of channels with redundant sensors.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub elements: BTreeMap<Element, Series>,
    /// Readings that are not good or arrived late, in order; others have no entry. A bad reading is NaN in its series.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub origins: BTreeMap<Channel, Vec<ReadingOrigin>>,
    /// Steps in order; in imported recordings found from changes of the command channels.
    pub steps: Vec<StepMarker>,
    /// Events in order.
    pub events: Vec<Event>,
}

/// Reason why a recording cannot be used.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum RecordingError {
    #[error("the recording has no channel {channel} ({}); name it in the channel map", channel.info().description)]
    MissingChannel { channel: Channel },
}

impl Recording {
    /// The series of a channel.
    ///
    /// # Errors
    /// [`RecordingError::MissingChannel`] if the channel is missing or empty.
    pub fn require(&self, channel: Channel) -> Result<&Series, RecordingError> {
        self.series
            .get(&channel)
            .filter(|series| !series.t_s.is_empty())
            .ok_or(RecordingError::MissingChannel { channel })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Series {
        Series { t_s: vec![0.0, 1.0, 3.0], values: vec![0.0, 10.0, 30.0] }
    }

    #[test]
    fn interpolation_is_exact_on_a_ramp_and_constant_beyond_it() {
        let values = [-1.0, 0.0, 0.5, 2.0, 3.0, 9.0].map(|t| ramp().interpolate(t).unwrap());
        assert_eq!(values, [0.0, 0.0, 5.0, 20.0, 30.0, 30.0]);
        assert_eq!(Series::default().interpolate(0.0), None);
    }

    #[test]
    fn a_held_value_changes_at_its_own_time() {
        let values = [-1.0, 0.0, 0.99, 1.0, 2.9, 3.0].map(|t| ramp().held(t).unwrap());
        assert_eq!(values, [0.0, 0.0, 0.0, 10.0, 10.0, 30.0]);
    }

    #[test]
    fn a_slice_keeps_both_ends() {
        assert_eq!(ramp().slice(1.0, 3.0).1, &[10.0, 30.0]);
        assert!(ramp().slice(2.0, 1.0).0.is_empty());
    }
}
