//! Quality and source time of readings. Only unusual ones are recorded: the others are good and were taken on arrival.

use crate::writing::recording_file::{McapFile, add_channel};
use crate::writing::topics::Topic;
use mapper_core::{Channel, Quality, ReadingOrigin, SampleBatch};
use mcap::McapResult;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Times that differ by less are equal, s. Bound: the jitter of clocks and threads.
const TIME_TOLERANCE_S: f64 = 1e-4;

/// Unusual provenance of one reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Origin {
    /// Run time of the reading at its source, s; `None`: on arrival.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    source_t_s: Option<f64>,
    /// `None`: good.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    quality: Option<Quality>,
}

/// One message: a sample, and its channels with unusual provenance.
pub(crate) type OriginMessage = BTreeMap<Channel, ReadingOrigin>;

/// Writes the messages; creates the topic only when needed, so that other recordings stay unchanged.
#[derive(Default)]
pub(crate) struct ProvenanceWriter {
    channel: Option<u16>,
}

impl ProvenanceWriter {
    /// The unusual provenance in a sample of a batch.
    pub(crate) fn message(&self, batch: &SampleBatch, index: usize) -> Option<serde_json::Value> {
        let t_s = *batch.t_s.get(index)?;
        let origin_of = |from: &mapper_core::Provenance| {
            // A missing reading has no source.
            let read = batch.column(from.channel).and_then(|values| values.get(index));
            let quality = from.quality.get(index).copied().filter(|quality| *quality != Quality::Good);
            if quality.is_none() && read.is_none_or(|value| !value.is_finite()) {
                return None;
            }
            let source_t_s = from.source_t_s.get(index).copied();
            let source_t_s = source_t_s
                .filter(|source_s| source_s.is_finite() && (source_s - t_s).abs() > TIME_TOLERANCE_S);
            let is_unusual = quality.is_some() || source_t_s.is_some();
            is_unusual.then_some((from.channel, Origin { source_t_s, quality }))
        };
        let message: BTreeMap<Channel, Origin> = batch.provenance.iter().filter_map(origin_of).collect();
        if message.is_empty() { None } else { serde_json::to_value(message).ok() }
    }

    /// The topic in the file.
    pub(crate) fn channel(&mut self, mcap: &mut McapFile) -> McapResult<u16> {
        if let Some(channel) = self.channel {
            return Ok(channel);
        }
        let channel = add_channel(mcap, &Topic::of_provenance())?;
        self.channel = Some(channel);
        Ok(channel)
    }
}

/// A parsed message; unknown channels are skipped.
pub(crate) fn read_origins(data: &[u8]) -> Option<OriginMessage> {
    let message: BTreeMap<String, serde_json::Value> = serde_json::from_slice(data).ok()?;
    let known = message.into_iter().filter_map(|(symbol, value)| {
        let origin: Origin = serde_json::from_value(value).ok()?;
        let source_t_s = origin.source_t_s.filter(|t_s| t_s.is_finite());
        let quality = origin.quality.unwrap_or(Quality::Good);
        Some((symbol.parse().ok()?, ReadingOrigin { t_s: 0.0, source_t_s, quality }))
    });
    Some(known.collect())
}
