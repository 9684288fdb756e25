//! JSON schema of a channel map. Messages quote its descriptions, so they describe what to write.
//!
//! Quantities are plain strings or numbers here: recordings of other programs spell units in more ways than campaigns
//! may, and a ratio may be written without a unit. [`crate::channel_mapping::channel_map_yaml`] parses them.

use crate::channel_mapping::channel_map::UNKNOWN_WORD;
use crate::logs::{LogOptions, OPTION_KEYS};
use mapper_core::{CHANNELS, MAX_ELEMENTS, NAMED_REFERENCES};
use mapper_yaml::Schema;
use mapper_yaml::keys::Key;
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

pub(crate) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| Schema::new(schema()));

fn schema() -> Value {
    let source = closed(
        &["field"],
        json!({
            "topic": text("Topic of the recording, or group of a log; a log with one group needs none.", "/rig/compressor"),
            "field": {
                "description": "Field of the topic's messages; a list of fields if several sensors measure the channel.",
                "examples": ["outlet_temperature"],
                "anyOf": [
                    {"type": "string", "minLength": 1},
                    {"type": "array", "minItems": 1, "maxItems": MAX_ELEMENTS, "uniqueItems": true, "items": {"type": "string", "minLength": 1}},
                ],
            },
            "unit": text("Unit of the field; the recording's own if none is given.", "degC"),
            "gauge": {"type": "boolean", "description": "Whether a pressure is read over `ambient_pressure`; absolute if not given.", "examples": [true]},
        }),
    );
    let sensor = closed(
        &[],
        json!({
            "noise": quantity("Noise of one sample; 0 if none is given.", "0.1 K"),
            "offset": quantity("Fixed offset left after calibration; 0 if none is given.", "0.25 K"),
            "gain": quantity("Fixed error of the gain; 0 if none is given.", "0.5 %"),
            "common_offset": quantity("Offset that several sensors of the channel share and that does not average out; 0 if none is given.", "0.05 K"),
        }),
    );
    let constant = quantity("Constant value of a channel that the recording does not contain.", "100 kPa");
    let mut channels = by_channel("Topic, field and unit of each channel, by the channel's symbol.", &source);
    channels.insert("minProperties".to_owned(), json!(1));
    closed(
        &["channels"],
        json!({
            "channels": channels,
            "constants": by_channel("Channels with a known constant value, by symbol.", &constant),
            "machine": machine(),
            "reference": reference(),
            "window": window(),
            "sensors": by_channel("Declared uncertainty of the sensors, one standard deviation, by symbol; if a channel has several sensors, that of each one.", &sensor),
            "noise_colour": noise_colour(),
            "ambient_pressure": ambient_pressure(),
            "log": log(),
        }),
    )
}

fn ambient_pressure() -> Value {
    let source = closed(
        &["field"],
        json!({
            "topic": text("Group of the log; a log with one group needs none.", "/rig/ambient"),
            "field": text("Column of the log.", "P_amb"),
            "unit": text("Unit of the column; the log's own if none is given.", "kPa"),
        }),
    );
    let uncertainty = || {
        quantity(
            "One standard deviation; 100 Pa for a reading and 1 kPa for an altitude if none is given.",
            "50 Pa",
        )
    };
    let value = || quantity("Reading of the barometer.", "99.2 kPa");
    let read = closed(&["value"], json!({"value": value(), "uncertainty": uncertainty()}));
    let altitude = quantity("Altitude of the stand above the sea.", "300 m");
    let place = closed(&["altitude"], json!({"altitude": altitude, "uncertainty": uncertainty()}));
    let unknown = json!({"type": "string", "enum": [UNKNOWN_WORD]});
    json!({
        "description": "Ambient pressure, which is added to gauge pressures: the reading of a barometer, the altitude of the stand, the column of a log, or `unknown`, which counts as 101.3 kPa with an uncertainty of 3 kPa.",
        "examples": ["99.2 kPa"],
        "anyOf": [value(), unknown, source, read, place],
    })
}

/// Settings of a log: the keys that its formats know.
fn log() -> Value {
    let key = |key: &Key<LogOptions>| (key.name.to_owned(), quantity(key.description, key.example));
    let keys: Map<String, Value> = OPTION_KEYS.iter().map(key).collect();
    closed(&[], keys.into())
}

fn machine() -> Value {
    closed(
        &["compressor_internal_area"],
        json!({
            "compressor_internal_area":
                quantity("Internal area of the compressor that exchanges heat with the gas.", "29e-3 m^2"),
            "alpha_area": quantity("Share of that area before compression, 0 to 1; 0 if none is given.", "0.2"),
            "compressor_inlet_diameter": quantity("Diameter of the inlet pipe; for a static tap.", "40 mm"),
            "compressor_outlet_diameter": quantity("Diameter of the outlet pipe; for a static tap.", "35 mm"),
            "t2_probe_diameter":
                quantity("Diameter of the tip of the T2 probe; 0 mm, the default, has no inertia.", "1.5 mm"),
        }),
    )
}

fn reference() -> Value {
    let names: Vec<&str> = NAMED_REFERENCES.iter().map(|row| row.name).collect();
    let state = closed(
        &["temperature", "pressure"],
        json!({
            "temperature": quantity("Reference temperature.", "298 K"),
            "pressure": quantity("Reference pressure.", "100 kPa"),
        }),
    );
    json!({
        "description": "State to which corrected flow and speed refer: a name, or `temperature` and `pressure`.",
        "examples": ["SAE"],
        "anyOf": [{"type": "string", "enum": names}, state],
    })
}

fn window() -> Value {
    closed(
        &["start", "end"],
        json!({
            "start": quantity("Start of the window after the start of the step.", "10 s"),
            "end": quantity("End of the window after the start of the step.", "110 s"),
        }),
    )
}

fn noise_colour() -> Value {
    closed(
        &["share", "time_constant"],
        json!({
            "share": quantity("Share of the noise that is first-order, in quadrature, 0 to 1.", "60 %"),
            "time_constant": quantity("Its time constant.", "2 s"),
        }),
    )
}

/// A mapping with these keys and no others.
fn closed(required: &[&str], properties: Value) -> Value {
    json!({"type": "object", "required": required, "properties": properties, "additionalProperties": false})
}

fn by_channel(description: &str, inner: &Value) -> Map<String, Value> {
    let properties: Map<String, Value> =
        CHANNELS.iter().map(|row| (row.symbol.to_owned(), inner.clone())).collect();
    let mut schema = Map::new();
    schema.insert("type".to_owned(), json!("object"));
    schema.insert("description".to_owned(), json!(description));
    schema.insert("properties".to_owned(), properties.into());
    schema.insert("additionalProperties".to_owned(), json!(false));
    schema
}

fn text(description: &str, example: &str) -> Value {
    json!({"type": "string", "minLength": 1, "description": description, "examples": [example]})
}

fn quantity(description: &str, example: &str) -> Value {
    json!({"type": ["string", "number"], "description": description, "examples": [example]})
}
