//! Keys whose values are text: in a file, or in the options of a command; the value `off`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};
use serde_json::Value;
use std::borrow::Cow;

/// The value `off`. `false` means the same: YAML 1.1 has one value for both, so PyYAML writes `false` for an `off` that it read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Off;

impl<'de> Deserialize<'de> for Off {
    fn deserialize<S: Deserializer<'de>>(deserializer: S) -> Result<Self, S::Error> {
        match Value::deserialize(deserializer)? {
            Value::Bool(false) => Ok(Off),
            Value::String(word) if word == "off" => Ok(Off),
            other => Err(de::Error::custom(format!("{other} is not `off`"))),
        }
    }
}

impl JsonSchema for Off {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Off".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": ["string", "boolean"], "enum": ["off", false]})
    }
}

/// Maximum number of characters of a wrong key or value in a message.
const MAX_SHOWN: usize = 60;

/// One key of a description `T`.
#[derive(Debug, Clone)]
pub struct Key<T> {
    /// Name in the file, and in the options of the commands.
    pub name: &'static str,
    /// Description in one line.
    pub description: &'static str,
    /// Example of a value.
    pub example: &'static str,
    /// Stores the value of a text; `None` if the text is not a value of the key.
    pub set: fn(&mut T, &str) -> Option<()>,
}

/// An unknown key, or an invalid value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum KeyError {
    #[error("there is no key `{key}`; the keys are {known}")]
    Unknown { key: String, known: String },
    #[error("`{value}` is not a value of `{key}`; write e.g. `{example}`")]
    Value { key: &'static str, value: String, example: &'static str },
}

/// Sets the key `name` of a description.
pub fn set_key<T>(keys: &[Key<T>], description: &mut T, name: &str, value: &str) -> Result<(), KeyError> {
    let shown = |text: &str| text.chars().take(MAX_SHOWN).collect();
    let Some(key) = keys.iter().find(|key| key.name == name) else {
        let names: Vec<&str> = keys.iter().map(|key| key.name).collect();
        return Err(KeyError::Unknown { key: shown(name), known: names.join(", ") });
    };
    (key.set)(description, value).ok_or_else(|| KeyError::Value {
        key: key.name,
        value: shown(value),
        example: key.example,
    })
}

/// Stores a value that was parsed; `None` if there is none.
pub fn store<T>(field: &mut Option<T>, value: Option<T>) -> Option<()> {
    *field = Some(value?);
    Some(())
}
