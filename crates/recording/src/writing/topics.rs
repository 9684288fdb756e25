//! Topics of a recording and their messages, for the file and for clients that receive the same data live.

use crate::format::{EVENT_TOPIC, PROVENANCE_TOPIC, STEP_TOPIC};
use crate::writing::schema::{Field, event_schema, numeric_schema, provenance_schema, step_schema};
use mapper_core::{Channel, Event, Group, StepMarker, step_number};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

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
pub struct Topic {
    /// E.g. `/rig/compressor`.
    pub name: &'static str,
    /// JSON schema of its messages, with unit, title and description of each field.
    pub schema: Vec<u8>,
    /// Units of the numeric fields by their names.
    pub units: BTreeMap<String, String>,
}

impl Topic {
    /// Readings of a device, of these of its channels.
    pub fn of_group(group: Group, channels: impl IntoIterator<Item = Channel>) -> Topic {
        let mut channels: Vec<Channel> =
            channels.into_iter().filter(|channel| channel.info().group == group).collect();
        channels.sort();
        let fields: Vec<Field<'_>> = channels.into_iter().map(|of| Field::of_channel(of.info())).collect();
        Topic::of_fields(group.topic(), &fields)
    }

    /// Numbers with their units.
    pub(crate) fn of_fields(name: &'static str, fields: &[Field<'_>]) -> Topic {
        let units = fields.iter().map(|field| (field.name.to_owned(), field.unit.to_owned())).collect();
        Topic { name, schema: numeric_schema(name, fields), units }
    }

    /// Starts and ends of steps.
    pub fn of_steps() -> Topic {
        let (schema, units) = step_schema();
        Topic { name: STEP_TOPIC, schema, units }
    }

    /// Messages of the rig and the runner.
    pub fn of_events() -> Topic {
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
pub fn step_message(step: &StepMarker, phase: StepPhase) -> (f64, Value) {
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
pub fn event_message(event: &Event) -> Value {
    json!({"t_s": event.t_s, "kind": event.kind, "message": event.message})
}

/// Message of a device's readings, SI; null if a value is not a number.
pub fn readings_message(group: Group, values: &[(Channel, f64)]) -> Value {
    let of_group = values.iter().filter(|(channel, _)| channel.info().group == group);
    let fields: Map<String, Value> =
        of_group.map(|(channel, value)| (channel.info().field.to_owned(), json!(value))).collect();
    Value::Object(fields)
}
