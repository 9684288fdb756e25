//! Names and version of the recording format; topics of a recording, their messages and JSON schemas.

use mapper_core::{ChannelInfo, Event, StepMarker, step_number};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

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

/// A topic as the recording defines it.
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

    /// Starts and ends of steps.
    pub(crate) fn of_steps() -> Topic {
        let (schema, units) = step_schema();
        Topic { name: STEP_TOPIC, schema, units }
    }

    /// Messages of the rig and the runner.
    pub(crate) fn of_events() -> Topic {
        let (schema, units) = event_schema();
        Topic { name: EVENT_TOPIC, schema, units }
    }

    /// Unusual provenance of readings.
    pub(crate) fn of_provenance() -> Topic {
        let (schema, units) = provenance_schema();
        Topic { name: PROVENANCE_TOPIC, schema, units }
    }
}

/// Run time, s, and message of a step's start or end.
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

/// Message of an event.
pub(crate) fn event_message(event: &Event) -> Value {
    json!({"t_s": event.t_s, "kind": event.kind, "message": event.message})
}

/// One numeric field of a topic.
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

/// Schema of a topic of flat numeric fields.
fn numeric_schema(title: &str, fields: &[Field<'_>]) -> Vec<u8> {
    let properties: Map<String, Value> =
        fields.iter().map(|field| (field.name.to_owned(), field.schema())).collect();
    object(title, properties)
}

/// Schema of `/step` with the units of its fields.
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

/// Schema of `/event` with the units of its fields.
fn event_schema() -> (Vec<u8>, BTreeMap<String, String>) {
    let properties = json!({
        "t_s": {"type": "number", "description": "run time", "unit": "s"},
        "kind": {"type": "string", "description": "kind of event"},
        "message": {"type": "string", "description": "one sentence with values and units"},
    });
    (typed("event", properties), BTreeMap::from([("t_s".to_owned(), "s".to_owned())]))
}

/// Schema of `/rig/provenance` with the units of its fields.
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
