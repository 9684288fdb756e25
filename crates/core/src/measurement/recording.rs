//! Recordings in memory: series of readings, samples of the rig, steps and events.

use crate::{Channel, Element, OperatingPoint, PlanStep, StepKind, step_number};
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
    pub fn require(&self, channel: Channel) -> Result<&Series, RecordingError> {
        self.series
            .get(&channel)
            .filter(|series| !series.t_s.is_empty())
            .ok_or(RecordingError::MissingChannel { channel })
    }
}

/// Kind of an [`Event`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The compressor crossed its surge line.
    SurgeEntered,
    /// The compressor returned from the surge side.
    SurgeLeft,
    /// The shaft exceeded the overspeed limit.
    OverspeedEntered,
    /// The shaft fell below the overspeed limit again.
    OverspeedLeft,
    /// A soak for a zero of the sensors began.
    SoakStarted,
    /// The soak ended.
    SoakEnded,
    /// A step ended away from its target speed.
    SpeedNotReached,
    /// A guard of the runner tripped.
    GuardTripped,
    /// A guard tripped that does not end the run; the message contains the reaction.
    GuardActed,
    /// The rig tripped by itself: it no longer follows its setpoints.
    RigTripped,
    /// The rig was put into its safe state.
    SafeState,
    /// The safe state was not reached, or the state of the rig is uncertain: an operator must acknowledge this before another run.
    Latched,
    /// The run continues after an interruption.
    Resumed,
    /// The run was stopped by its operator.
    Interrupted,
    /// A remark for people.
    Note,
}

/// Something that happened at an instant of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Run time, s.
    pub t_s: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// One sentence with values and units.
    pub message: String,
}

/// The samples of one channel in a batch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelColumn {
    /// Channel.
    pub channel: Channel,
    /// SI values, as long as the batch's `t_s`; NaN for missing readings.
    pub values: Vec<f64>,
}

/// The samples of one of several sensors of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ElementColumn {
    /// Sensor.
    pub element: Element,
    /// SI values, as long as the batch's `t_s`. NaN if the sensor gave nothing.
    pub values: Vec<f64>,
}

/// Quality of a reading, as reported by the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Good.
    Good,
    /// Uncertain; guards use it.
    Uncertain,
    /// Invalid, whatever its value.
    Bad,
}

/// Provenance of a channel's readings, in addition to their arrival times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Channel.
    pub channel: Channel,
    /// When the source took each reading, s since arming; as long as the batch's `t_s`.
    pub source_t_s: Vec<f64>,
    /// Quality of each reading; as long as the batch's `t_s`.
    pub quality: Vec<Quality>,
}

/// Truth from a simulator; recorded under `/truth`, read only by scoring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthColumn {
    /// Name with its unit suffix, e.g. `h_w_m2k`.
    pub name: String,
    /// Unit, e.g. `W/(m2 K)`.
    pub unit: String,
    /// Values, as long as the batch's `t_s`.
    pub values: Vec<f64>,
}

/// Fast samples of a channel, evenly spaced: what its own column has every tenth of a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FastSamples {
    /// The channel: one with a [`variation`](Channel::variation).
    pub channel: Channel,
    /// Time of the first since arming, s.
    pub first_s: f64,
    /// Interval, s, > 0.
    pub interval_s: f64,
    /// SI.
    pub values: Vec<f64>,
}

/// All samples between two polls of a backend.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SampleBatch {
    /// Sequence number of the first sample; consecutive over the run, so a loss shows as a jump.
    pub first_sequence: u64,
    /// Sample times since arming, s, strictly increasing.
    pub t_s: Vec<f64>,
    /// One column per channel; for a channel with several sensors the combined reading
    /// ([`RedundantSensors::live`](crate::RedundantSensors::live)).
    pub columns: Vec<ChannelColumn>,
    /// Each sensor of channels with redundant sensors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub elements: Vec<ElementColumn>,
    /// Fast samples of pressures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fast: Vec<FastSamples>,
    /// Channels with readings that are not good or arrived late; others have no entry.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub provenance: Vec<Provenance>,
    /// Truth of a simulated rig; empty for a real one.
    pub truth: Vec<TruthColumn>,
    /// Events since the last poll.
    pub events: Vec<Event>,
}

impl SampleBatch {
    /// The values of one channel, if the rig has it.
    pub fn column(&self, channel: Channel) -> Option<&[f64]> {
        self.columns.iter().find(|column| column.channel == channel).map(|c| c.values.as_slice())
    }

    /// Provenance of a channel's readings; `None` if every reading is good and arrived immediately.
    pub fn provenance_of(&self, channel: Channel) -> Option<&Provenance> {
        self.provenance.iter().find(|provenance| provenance.channel == channel)
    }

    /// The latest value of one channel, if there is one.
    pub fn last(&self, channel: Channel) -> Option<f64> {
        self.column(channel).and_then(|values| values.last().copied())
    }
}

/// Start and end of one executed step (or of one found in an imported recording).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StepMarker {
    /// Index of the step in its plan, or in order of appearance, from 0; files have its number, from 1.
    #[serde(flatten, with = "crate::test_plan::step_number::entry")]
    pub index: usize,
    /// Point or repeat.
    pub kind: StepKind,
    /// Run time of the change of setpoints, s.
    pub start_s: f64,
    /// Run time of the step's end, s.
    pub end_s: f64,
    /// The point before the jump; `None` for the first step, and in imported recordings.
    pub from: Option<OperatingPoint>,
    /// The target of the plan; `None` in imported recordings.
    pub to: Option<OperatingPoint>,
    /// Commanded turbine inlet total pressure, Pa.
    pub p3_pa: f64,
    /// Commanded valve opening relative to the nominal area.
    #[serde(rename = "valve")]
    pub valve_opening_ratio: f64,
}

impl StepMarker {
    /// First index of steps that a resumed run repeats outside its plan. Bound: no plan has that many steps.
    pub const FIRST_REPEAT_INDEX: usize = 1_000_000;

    /// Number of the step in its run, from 1; `None` for a repeated step outside the plan.
    pub fn number(&self) -> Option<usize> {
        (self.index < StepMarker::FIRST_REPEAT_INDEX).then(|| step_number(self.index))
    }
}

/// The step as it would be recorded without delays.
impl From<&PlanStep> for StepMarker {
    fn from(step: &PlanStep) -> Self {
        StepMarker {
            index: step.index,
            kind: step.kind,
            start_s: step.start_s,
            end_s: step.start_s + step.dwell_s,
            from: step.from,
            to: Some(step.to),
            p3_pa: step.p3_pa,
            valve_opening_ratio: step.to.valve_opening_ratio,
        }
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
