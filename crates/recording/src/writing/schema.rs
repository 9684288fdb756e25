//! JSON schemas of the topics, with unit, title and description of each field.

use mapper_core::ChannelInfo;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

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
pub(crate) fn numeric_schema(title: &str, fields: &[Field<'_>]) -> Vec<u8> {
    let properties: Map<String, Value> =
        fields.iter().map(|field| (field.name.to_owned(), field.schema())).collect();
    object(title, properties)
}

/// Schema of `/step` with the units of its fields.
pub(crate) fn step_schema() -> (Vec<u8>, BTreeMap<String, String>) {
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
pub(crate) fn event_schema() -> (Vec<u8>, BTreeMap<String, String>) {
    let properties = json!({
        "t_s": {"type": "number", "description": "run time", "unit": "s"},
        "kind": {"type": "string", "description": "kind of event"},
        "message": {"type": "string", "description": "one sentence with values and units"},
    });
    (typed("event", properties), BTreeMap::from([("t_s".to_owned(), "s".to_owned())]))
}

/// Schema of `/rig/provenance` with the units of its fields.
pub(crate) fn provenance_schema() -> (Vec<u8>, BTreeMap<String, String>) {
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
