//! The JSON schema of all messages, generated from the types that read and write them.

use crate::protocol::{
    Configure, DescribeResult, Failure, Hello, LastSample, Message, Poll, Samples, Welcome,
};
use mapper_core::Setpoints;
use proptest::prelude::*;
use schemars::{JsonSchema, generate::SchemaSettings};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// `note`: a remark of the driver for the user.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "the host reads the message alone")]
struct Note {
    /// One sentence.
    message: String,
}

/// The schema: `Message` describes the content of a frame, the others describe `params` and `result` of each method.
fn schema() -> Value {
    let mut generator = SchemaSettings::draft2020_12().into_generator();
    let message = generator.subschema_for::<Message>();
    let methods = json!({
        "hello": {"params": generator.subschema_for::<Hello>(), "result": generator.subschema_for::<Welcome>()},
        "configure": {"params": generator.subschema_for::<Configure>(), "result": {}},
        "describe": {"result": generator.subschema_for::<DescribeResult>()},
        "arm": {"result": {}},
        "set": {"params": generator.subschema_for::<Setpoints>(), "result": {}},
        "hold": {"result": {}},
        "poll": {"params": generator.subschema_for::<Poll>(), "result": generator.subschema_for::<LastSample>()},
        "make_safe": {"result": {}},
        "disarm": {"result": {}},
        "lease": {},
        "samples": {"params": generator.subschema_for::<Samples>()},
        "lost": {"params": generator.subschema_for::<Failure>()},
        "note": {"params": generator.subschema_for::<Note>()},
    });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Messages between mapper and a driver",
        "allOf": [message],
        "x-methods": methods,
        "$defs": generator.take_definitions(true),
    })
}

/// Valid examples of messages: method, part of the message, content.
fn examples() -> [(&'static str, &'static str, Value); 9] {
    let hello = json!({
        "magic": "mapper-backend", "protocol": {"major": 1, "minor": 1}, "name": "x", "version": "1", "frame_limit_bytes": 65536,
    });
    let mut welcome = hello.clone();
    welcome["session"] = json!("s");
    [
        ("hello", "params", hello),
        ("hello", "result", welcome),
        ("configure", "params", json!({"settings": {"password": {"env": "NAME"}}})),
        (
            "describe",
            "result",
            json!({"identity": "x", "description": {
                "channels": [{"name": "T2", "unit": "K", "sensors": 2}, {"name": "N", "unit": "rpm"}], "sample_rate_hz": 10.5,
                "simulated_time": true, "exclusive": "cell_3", "needs_guarded": ["overspeed"],
                "accepts": {"p3_pa": [1.5, 2.5], "t3_k": [1.5, 2.5], "valve_opening_ratio": [0.1, 2.5], "oil_temperature_k": [1.5, 2.5]},
                "safe": {"p3_slew_pa_s": null, "valve_opening_ratio": 1.5, "within_s": 1.5},
            }}),
        ),
        (
            "set",
            "params",
            json!({"mode": "running", "p3_pa": 1.5, "t3_k": 1.5, "valve_opening_ratio": 0.7, "oil_temperature_k": 1.5}),
        ),
        ("poll", "params", json!({"until_s": 1.5})),
        ("poll", "result", json!({"next_sequence": 7})),
        (
            "samples",
            "params",
            json!({
                "stream": "rig", "sequence": 3, "t_s": [0.5, 1.5],
                "columns": [{"channel": "T2", "values": [300.5, null], "source_t_s": [0.25, 1.25], "quality": ["good", "bad"]}],
                "elements": [{"element": "T2/1", "values": [1.5, null]}],
                "truth": [{"name": "x", "unit": "K", "values": [1.5, 2.5]}],
                "events": [{"t_s": 0.5, "kind": "rig_tripped", "message": "x"}],
            }),
        ),
        ("lost", "params", json!({"code": "lost", "message": "x", "t_s": 1.5})),
    ]
}

/// Reads a message and converts it to the types of the core, as this crate does.
fn read(method: &str, part: &str, value: Value) -> Result<(), serde_json::Error> {
    match (method, part) {
        ("hello", "params") => serde_json::from_value::<Hello>(value).map(drop),
        ("hello", _) => serde_json::from_value::<Welcome>(value).map(drop),
        ("configure", _) => serde_json::from_value::<Configure>(value).map(drop),
        ("describe", _) => serde_json::from_value::<DescribeResult>(value).map(|described| {
            let _ = crate::protocol::read_description(&described.description, "x", "1");
        }),
        ("set", _) => serde_json::from_value::<Setpoints>(value).map(drop),
        ("poll", "params") => serde_json::from_value::<Poll>(value).map(drop),
        ("poll", _) => serde_json::from_value::<LastSample>(value).map(drop),
        ("samples", _) => serde_json::from_value::<Samples>(value).map(|samples| {
            let _ = crate::protocol::batch(samples, &[mapper_core::Channel::T2]);
        }),
        _ => serde_json::from_value::<Failure>(value)
            .map(|failure| drop(crate::protocol::read_error(failure, "x", "set", 0.0))),
    }
}

fn validators() -> BTreeMap<(&'static str, &'static str), jsonschema::Validator> {
    let definitions = schema();
    let definition_of = |(method, part, _): (&'static str, &'static str, Value)| {
        let mut schema = definitions["x-methods"][method][part].clone();
        schema["$defs"] = definitions["$defs"].clone();
        ((method, part), jsonschema::validator_for(&schema).unwrap())
    };
    examples().into_iter().map(definition_of).collect()
}

/// Lists the paths of a value and of everything inside it.
fn collect_paths(value: &Value, here: &str, all: &mut Vec<String>) {
    all.push(here.to_owned());
    let inside: Vec<(String, &Value)> = match value {
        Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), value)).collect(),
        Value::Array(list) => list.iter().enumerate().map(|(at, value)| (at.to_string(), value)).collect(),
        _ => Vec::new(),
    };
    inside.into_iter().for_each(|(key, value)| collect_paths(value, &format!("{here}/{key}"), all));
}

/// An arbitrary value. Numbers have a fraction, because a schema accepts 1.0 as an integer and the reader does not.
fn arbitrary_value() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        (-1000i32..70_000).prop_map(Value::from),
        (-1e9f64..1e9).prop_map(|number| json!(number.floor() + 0.5)),
        "[a-zA-Z_0-9/]{0,12}".prop_map(Value::from),
        prop::collection::vec(any::<bool>(), 0..3).prop_map(Value::from),
        Just(json!({"name": "T2", "values": [], "t_s": [null]})),
    ]
}

#[test]
fn valid_messages_match_the_schema_and_are_read() {
    let validators = validators();
    for (method, part, value) in examples() {
        assert!(validators[&(method, part)].is_valid(&value), "{method} {part}");
        read(method, part, value).unwrap();
    }
}

proptest! {
    /// Valid messages with up to four values changed or removed: nothing panics, and a message that matches the schema is read.
    #[test]
    fn messages_that_match_the_schema_are_read(
        which in 0usize..9, changes in prop::collection::vec((any::<prop::sample::Index>(), prop::option::of(arbitrary_value())), 0..4),
    ) {
        thread_local! { static VALIDATORS: BTreeMap<(&'static str, &'static str), jsonschema::Validator> = validators(); }
        let (method, part, mut value) = examples()[which].clone();
        for (at, replacement) in changes {
            let mut all = Vec::new();
            collect_paths(&value, "", &mut all);
            let place = at.get(&all).clone();
            match (replacement, place.rsplit_once('/')) {
                (Some(replacement), _) => *value.pointer_mut(&place).unwrap() = replacement,
                (None, Some((above, key))) => {
                    if let Some(Value::Object(map)) = value.pointer_mut(above) {
                        map.remove(key);
                    }
                }
                (None, None) => {}
            }
        }
        let fits = VALIDATORS.with(|validators| validators[&(method, part)].is_valid(&value));
        let read = read(method, part, value.clone());
        prop_assert!(!fits || read.is_ok(), "{} {}: {} is {:?}", method, part, value, read);
    }
}

/// The committed schema, which authors of drivers use, matches the types. To generate it again:
/// `MAPPER_WRITE_SCHEMA=1 cargo test --locked -p mapper-driver-host the_committed_schema`.
#[test]
fn the_committed_schema_matches_the_types() {
    let file =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/protocol.schema.json");
    let made = format!("{}\n", serde_json::to_string_pretty(&schema()).unwrap());
    if std::env::var_os("MAPPER_WRITE_SCHEMA").is_some() {
        std::fs::write(&file, &made).unwrap();
    }
    assert_eq!(
        std::fs::read_to_string(&file).unwrap(),
        made,
        "generate docs/reference/protocol.schema.json again"
    );
}
