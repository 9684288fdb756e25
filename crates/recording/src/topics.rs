//! Topics of a recording and their messages.

use crate::run_file::RunFile;
use mapper_core::{
    Channel, ChannelInfo, Event, Quality, ReadingOrigin, SampleBatch, StepMarker, step_number,
};
use mcap::records::Metadata;
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, McapResult, WriteOptions, Writer};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;
use std::io::BufWriter;

/// Version of the recording format.
///
/// Increased when a reader of the previous version would misread a file: a topic, field or unit changes its meaning. New
/// topics, fields and metadata keys do not increase it, since readers skip unknown ones.
///
/// Version 2 numbers the steps on `/step` from 1, as `step`. Version 1 has `index` there, from 0, and can still be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FormatVersion(pub u32);

impl FormatVersion {
    /// Version written by this program.
    pub const CURRENT: FormatVersion = FormatVersion(2);
}

impl std::fmt::Display for FormatVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

pub(crate) const STEP_TOPIC: &str = "/step";
pub(crate) const EVENT_TOPIC: &str = "/event";
/// Topic of the single sensors of channels that have several.
pub(crate) const ELEMENTS_TOPIC: &str = "/rig/elements";
/// Topic of fast samples, in windows.
pub(crate) const FAST_TOPIC: &str = "/rig/fast";
/// Topic of readings with an unusual quality or source time.
pub(crate) const PROVENANCE_TOPIC: &str = "/rig/provenance";
pub(crate) const TRUTH_TOPIC: &str = "/truth/model";
/// Everything below this topic is for scoring only.
pub(crate) const TRUTH_PREFIX: &str = "/truth";
/// Name of the metadata record that marks a recording of this program.
pub(crate) const METADATA_NAME: &str = "mapper.recording";
/// Key of the format version in the metadata record.
pub(crate) const FORMAT_KEY: &str = "format";
/// Key of the epoch time of run time 0, in nanoseconds.
pub(crate) const START_KEY: &str = "start_time_ns";
pub(crate) const PLAN_NAME: &str = "plan.json";
pub(crate) const CAMPAIGN_NAME: &str = "campaign.yaml";

/// The end of a step that a marker refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepPhase {
    /// The setpoints change; the marker's `start_s` counts, its `end_s` is not written.
    Start,
    /// The step is over; the marker's `end_s` counts.
    End,
    /// The step was aborted; the marker's `end_s` counts.
    Abandoned,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topic {
    /// E.g. `/rig/compressor`.
    pub name: &'static str,
    /// JSON schema of its messages, with unit, title and description of each field.
    pub schema: Vec<u8>,
    /// Units of the numeric fields by their names.
    pub units: BTreeMap<String, String>,
}

impl Topic {
    /// Numbers with their units.
    pub(crate) fn of_fields(name: &'static str, fields: &[Field<'_>]) -> Topic {
        let units = fields.iter().map(|field| (field.name.to_owned(), field.unit.to_owned())).collect();
        Topic { name, schema: numeric_schema(name, fields), units }
    }

    pub(crate) fn of_steps() -> Topic {
        let (schema, units) = step_schema();
        Topic { name: STEP_TOPIC, schema, units }
    }

    pub(crate) fn of_events() -> Topic {
        let (schema, units) = event_schema();
        Topic { name: EVENT_TOPIC, schema, units }
    }

    pub(crate) fn of_fast_samples() -> Topic {
        let properties = json!({
            "channel": {"type": "string", "description": "symbol of the channel"},
            "first_s": {"type": "number", "description": "run time of the first value", "unit": "s"},
            "interval_s": {"type": "number", "description": "time from value to value", "unit": "s"},
            "values": {"type": "array", "items": {"type": "number"}, "description": "readings in the channel's unit"},
        });
        let units = ["first_s", "interval_s"].map(|name| (name.to_owned(), "s".to_owned()));
        Topic { name: FAST_TOPIC, schema: typed("fast", properties), units: units.into() }
    }

    pub(crate) fn of_provenance() -> Topic {
        let (schema, units) = provenance_schema();
        Topic { name: PROVENANCE_TOPIC, schema, units }
    }
}

pub(crate) fn step_message(step: &StepMarker, phase: StepPhase) -> (f64, Value) {
    let (t_s, phase) = match phase {
        StepPhase::Start => (step.start_s, "start"),
        StepPhase::End => (step.end_s, "end"),
        StepPhase::Abandoned => (step.end_s, "abandoned"),
    };
    let message = json!({
        "step": step_number(step.index), "kind": step.kind, "phase": phase, "t_s": t_s,
        "p3_pa": step.p3_pa, "valve": step.valve_opening_ratio, "from": step.from, "to": step.to,
    });
    (t_s, message)
}

pub(crate) fn event_message(event: &Event) -> Value {
    json!({"t_s": event.t_s, "kind": event.kind, "message": event.message})
}

pub(crate) struct Field<'a> {
    pub(crate) name: &'a str,
    pub(crate) title: &'a str,
    pub(crate) description: &'a str,
    pub(crate) unit: &'a str,
}

impl<'a> Field<'a> {
    pub(crate) fn of_channel(row: &'static ChannelInfo) -> Field<'static> {
        Field { name: row.field, title: row.symbol, description: row.description, unit: row.dimension.unit() }
    }

    fn schema(&self) -> Value {
        // The type is plain `number` although a value may be null: viewers reject a list of types, and skip
        // nulls.
        json!({"type": "number", "title": self.title, "description": self.description, "unit": self.unit})
    }
}

fn numeric_schema(title: &str, fields: &[Field<'_>]) -> Vec<u8> {
    let properties: Map<String, Value> =
        fields.iter().map(|field| (field.name.to_owned(), field.schema())).collect();
    object(title, properties)
}

fn step_schema() -> (Vec<u8>, BTreeMap<String, String>) {
    let point = |description: &str| {
        json!({"type": "object", "description": description, "properties": {
            "speed_rpm": {"type": "number", "description": "target shaft speed", "unit": "rpm"},
            "valve": {"type": "number", "description": "valve opening, relative to the nominal area", "unit": "1"},
        }})
    };
    let properties = json!({
        "step": {"type": "integer", "description": "number of the step, from 1", "unit": "1"},
        "kind": {"type": "string", "description": "point or repeat"},
        "phase": {"type": "string", "description": "start or end of the step"},
        "t_s": {"type": "number", "description": "run time", "unit": "s"},
        "p3_pa": {"type": "number", "description": "commanded turbine inlet total pressure", "unit": "Pa"},
        "valve": {"type": "number", "description": "commanded valve opening, relative to the nominal area", "unit": "1"},
        "from": point("where the plan came from"),
        "to": point("where the plan aimed"),
    });
    let units = [("t_s", "s"), ("p3_pa", "Pa"), ("valve", "1")]
        .map(|(name, unit)| (name.to_owned(), unit.to_owned()));
    (typed("step", properties), BTreeMap::from(units))
}

fn event_schema() -> (Vec<u8>, BTreeMap<String, String>) {
    let properties = json!({
        "t_s": {"type": "number", "description": "run time", "unit": "s"},
        "kind": {"type": "string", "description": "kind of event"},
        "message": {"type": "string", "description": "one sentence with values and units"},
    });
    (typed("event", properties), BTreeMap::from([("t_s".to_owned(), "s".to_owned())]))
}

fn provenance_schema() -> (Vec<u8>, BTreeMap<String, String>) {
    let of = |row: &ChannelInfo| {
        json!({"type": "object", "description": row.description, "properties": {
            "source_t_s": {"type": "number", "description": "run time at which the source took the reading, if it differs from the message's", "unit": "s"},
            "quality": {"type": "string", "description": "uncertain or bad, as the rig reports; absent if good"},
        }})
    };
    let properties: Map<String, Value> =
        mapper_core::CHANNELS.iter().map(|row| (row.symbol.to_owned(), of(row))).collect();
    (object("provenance", properties), BTreeMap::from([("source_t_s".to_owned(), "s".to_owned())]))
}

fn typed(title: &str, properties: Value) -> Vec<u8> {
    match properties {
        Value::Object(properties) => object(title, properties),
        _ => object(title, Map::new()),
    }
}

fn object(title: &str, properties: Map<String, Value>) -> Vec<u8> {
    json!({"title": title, "type": "object", "properties": properties}).to_string().into_bytes()
}

/// Chunks are built in memory, without seeking, so that the file ends with a whole chunk at every flush.
pub(crate) type McapFile = Writer<NoSeek<BufWriter<RunFile>>>;

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
pub(crate) fn open(file: RunFile, header: &RecordingHeader) -> McapResult<OpenedFile> {
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

pub(crate) fn add_channel(mcap: &mut McapFile, topic: &Topic) -> McapResult<u16> {
    let name = topic.name.trim_start_matches('/').replace('/', ".");
    let schema_id = mcap.add_schema(&name, "jsonschema", &topic.schema)?;
    mcap.add_channel(schema_id, topic.name, "json", &topic.units)
}

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

    pub(crate) fn channel(&mut self, mcap: &mut McapFile) -> McapResult<u16> {
        if let Some(channel) = self.channel {
            return Ok(channel);
        }
        let channel = add_channel(mcap, &Topic::of_provenance())?;
        self.channel = Some(channel);
        Ok(channel)
    }
}

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
