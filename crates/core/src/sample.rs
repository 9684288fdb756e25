//! Samples as a backend hands them over: columns over a common time base.

use crate::{Channel, Element, Event};
use serde::{Deserialize, Serialize};

/// The samples of one channel in a batch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelColumn {
    /// Which quantity.
    pub channel: Channel,
    /// SI values, as long as the batch's `t_s`. NaN where the sensor gave nothing.
    pub values: Vec<f64>,
}

/// The samples of one of several sensors of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ElementColumn {
    /// Which sensor.
    pub element: Element,
    /// SI values, as long as the batch's `t_s`. NaN where the sensor gave nothing.
    pub values: Vec<f64>,
}

/// How good a reading is, by the rig's own word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Good.
    Good,
    /// To be used with doubt; guards take it.
    Uncertain,
    /// No reading at all, whatever number stands there.
    Bad,
}

/// Where the readings of a channel come from: beside the time at which they arrived.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Which quantity.
    pub channel: Channel,
    /// When the source took each reading, s since arming; as long as the batch's `t_s`.
    pub source_t_s: Vec<f64>,
    /// How good each is; as long as the batch's `t_s`.
    pub quality: Vec<Quality>,
}

/// What only a simulator knows; recorded under `/truth`, read by scoring alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthColumn {
    /// Name with its unit suffix, e.g. `h_w_m2k`.
    pub name: String,
    /// Unit, e.g. `W/(m2 K)`.
    pub unit: String,
    /// Values, as long as the batch's `t_s`.
    pub values: Vec<f64>,
}

/// All samples between two polls of a backend.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SampleBatch {
    /// Sequence number of the first sample; consecutive over the run, so a loss shows as a jump.
    pub first_sequence: u64,
    /// Sample times since arming, s, strictly increasing.
    pub t_s: Vec<f64>,
    /// One column per channel; of a channel with several sensors what they read together
    /// ([`RedundantSensors::live`](crate::RedundantSensors::live)).
    pub columns: Vec<ChannelColumn>,
    /// Each sensor of the channels that have several; empty where none has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub elements: Vec<ElementColumn>,
    /// Channels whose readings are not all good, or not taken when they arrived; others need none.
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

    /// Where the readings of one channel come from; `None`: each was good, and taken when it arrived.
    pub fn provenance_of(&self, channel: Channel) -> Option<&Provenance> {
        self.provenance.iter().find(|provenance| provenance.channel == channel)
    }

    /// The latest value of one channel, if there is any.
    pub fn last(&self, channel: Channel) -> Option<f64> {
        self.column(channel).and_then(|values| values.last().copied())
    }
}
