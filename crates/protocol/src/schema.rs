//! The JSON schema of all messages, made from the types that read and write them.

use crate::{
    Configure, Described, Failure, Hello, LastSample, Message, Note, Poll, Samples, Setpoints, Welcome,
};
use schemars::generate::SchemaSettings;
use serde_json::{Value, json};

/// The schema: `Message` is what a frame holds, the others what `params` and `result` hold, by method.
pub fn schema() -> Value {
    let mut generator = SchemaSettings::draft2020_12().into_generator();
    let message = generator.subschema_for::<Message>();
    let methods = json!({
        "hello": {"params": generator.subschema_for::<Hello>(), "result": generator.subschema_for::<Welcome>()},
        "configure": {"params": generator.subschema_for::<Configure>(), "result": {}},
        "describe": {"result": generator.subschema_for::<Described>()},
        "arm": {"result": {}},
        "set": {"params": generator.subschema_for::<Setpoints>(), "result": {}},
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

#[cfg(test)]
mod tests {
    /// What is committed for authors of drivers is what this crate reads and writes. To make it again:
    /// `MAPPER_WRITE_SCHEMA=1 cargo test -p mapper-protocol the_committed_schema`.
    #[test]
    fn the_committed_schema_is_that_of_the_types() {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/protocol.schema.json");
        let made = format!("{}\n", serde_json::to_string_pretty(&super::schema()).unwrap());
        if std::env::var_os("MAPPER_WRITE_SCHEMA").is_some() {
            std::fs::write(&file, &made).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&file).unwrap(), made, "make docs/protocol.schema.json again");
    }
}
