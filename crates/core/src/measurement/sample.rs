//! Samples from a backend: columns over a common time base.

use crate::{Channel, Element, Event};
use serde::{Deserialize, Serialize};

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
