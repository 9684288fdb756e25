//! The file of a recording: its header, metadata, attachments and topics.

use crate::FormatVersion;
use crate::format::{CAMPAIGN_NAME, FORMAT_KEY, METADATA_NAME, PLAN_NAME, START_KEY};
use crate::writing::topics::Topic;
use mcap::records::Metadata;
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, McapResult, WriteOptions, Writer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};

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
