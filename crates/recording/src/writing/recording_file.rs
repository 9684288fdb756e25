//! The file of a recording: header, metadata, attachments and topics; quality and source time of unusual readings (the others are good and were taken on arrival).

use crate::FormatVersion;
use crate::writing::topics::{CAMPAIGN_NAME, FORMAT_KEY, METADATA_NAME, PLAN_NAME, START_KEY, Topic};
use mapper_core::{Channel, Quality, ReadingOrigin, SampleBatch};
use mcap::records::Metadata;
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, McapResult, WriteOptions, Writer};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::io::BufWriter;

/// Chunks are built in memory, without seeking, so that the file ends with a whole chunk at every flush.
pub(crate) type McapFile = Writer<NoSeek<BufWriter<File>>>;

/// A file that is ready for messages.
pub(crate) struct OpenedFile {
    pub(crate) mcap: McapFile,
    pub(crate) step_channel: u16,
    pub(crate) event_channel: u16,
}

/// Metadata of a recording that precede its first sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordingHeader {
    /// Program and version that writes, e.g. `mapper 0.1.0`.
    pub library: String,
    /// MCAP profile; empty for none.
    pub profile: String,
    /// Time of run time 0 in nanoseconds since 1970-01-01 UTC. An argument, so that equal runs give equal bytes.
    pub start_time_ns: u64,
    /// Campaign, seed, program version, reference state and further metadata, as text.
    pub metadata: BTreeMap<String, String>,
    /// The plan as JSON, attached as `plan.json`.
    pub plan_json: Option<Vec<u8>>,
    /// The campaign as it was read, attached as `campaign.yaml`.
    pub campaign_yaml: Option<Vec<u8>>,
}

/// Starts the file: header, metadata, attachments, and the two topics that every recording has.
pub(crate) fn open(file: File, header: &RecordingHeader) -> McapResult<OpenedFile> {
    let mut mcap = WriteOptions::new()
        .profile(&header.profile)
        .library(&header.library)
        .compression(Some(Compression::Zstd))
        // Higher levels hardly compress digits any better, at several times the cost.
        .compression_level(1)
        // Equal inputs give equal bytes on any number of cores.
        .compression_threads(0)
        // Only the clock ends chunks, so that their bounds do not depend on their content.
        .chunk_size(None)
        .disable_seeking(true)
        .create(NoSeek::new(BufWriter::with_capacity(1 << 16, file)))?;
    let mut metadata = header.metadata.clone();
    metadata.insert(FORMAT_KEY.to_owned(), FormatVersion::CURRENT.to_string());
    metadata.insert(START_KEY.to_owned(), header.start_time_ns.to_string());
    mcap.write_metadata(&Metadata { name: METADATA_NAME.to_owned(), metadata })?;
    let attachments = [
        (PLAN_NAME, "application/json", &header.plan_json),
        (CAMPAIGN_NAME, "application/yaml", &header.campaign_yaml),
    ];
    for (name, media_type, data) in attachments {
        if let Some(data) = data {
            mcap.attach(&Attachment {
                log_time: header.start_time_ns,
                create_time: header.start_time_ns,
                name: name.to_owned(),
                media_type: media_type.to_owned(),
                data: Cow::Borrowed(data),
            })?;
        }
    }
    let step_channel = add_channel(&mut mcap, &Topic::of_steps())?;
    let event_channel = add_channel(&mut mcap, &Topic::of_events())?;
    mcap.flush()?;
    Ok(OpenedFile { mcap, step_channel, event_channel })
}

/// Defines a topic.
pub(crate) fn add_channel(mcap: &mut McapFile, topic: &Topic) -> McapResult<u16> {
    let name = topic.name.trim_start_matches('/').replace('/', ".");
    let schema_id = mcap.add_schema(&name, "jsonschema", &topic.schema)?;
    mcap.add_channel(schema_id, topic.name, "json", &topic.units)
}

/// The error of the system, or that of `mcap`.
pub(crate) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(source) => source,
        other => io::Error::other(other),
    }
}

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
