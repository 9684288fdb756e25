//! A JSON schema generated from a type, for editors and for the checks of files.

use crate::schema_check::messages::keys_of;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, generate::SchemaSettings};
use serde_json::{Map, Value};

/// The schema of a kind of file.
#[derive(Debug, Clone)]
pub struct Schema {
    pub(crate) value: Value,
}

impl Schema {
    /// The schema of a type.
    pub fn of<T: JsonSchema>() -> Self {
        Schema::new(json_schema_of::<T>())
    }

    /// A schema from its JSON value.
    pub fn new(value: Value) -> Self {
        Schema { value }
    }

    /// The keys of the file.
    pub fn keys(&self) -> Vec<&str> {
        self.value.as_object().map(keys_of).unwrap_or_default()
    }
}

/// JSON schema (draft 2020-12) of a type, for editors and other tools.
///
/// Quantities are strings; `x-quantity` names their kind, `x-min`, `x-max` and `x-above` their range.
pub fn json_schema_of<T: JsonSchema>() -> Value {
    let mut settings = SchemaSettings::draft2020_12();
    // Subschemas are inlined instead of `$ref`, so that each key has its own description.
    settings.inline_subschemas = true;
    settings.transforms.push(Box::new(WithoutNull));
    settings.into_generator().into_root_schema_for::<T>().to_value()
}

/// Removes `null` from optional values: a key may be omitted, but not be empty.
#[derive(Debug, Clone)]
struct WithoutNull;

impl Transform for WithoutNull {
    fn transform(&mut self, schema: &mut schemars::Schema) {
        transform_subschemas(self, schema);
        if let Some(object) = schema.as_object_mut() {
            without_null(object);
        }
    }
}

fn without_null(object: &mut Map<String, Value>) {
    if let Some(Value::Array(types)) = object.get_mut("type") {
        types.retain(|name| name != "null");
        if let [single] = types.as_slice() {
            let single = single.clone();
            object.insert("type".into(), single);
        }
    }
    if let Some(Value::Array(values)) = object.get_mut("enum") {
        values.retain(|value| !value.is_null());
    }
    if let Some(Value::Array(branches)) = object.get_mut("anyOf") {
        branches.retain(|branch| branch.get("type") != Some(&Value::String("null".into())));
        if let [Value::Object(single)] = branches.as_mut_slice() {
            let single = std::mem::take(single);
            object.remove("anyOf");
            for (key, value) in single {
                object.entry(key).or_insert(value);
            }
        }
    }
    if object.get("default") == Some(&Value::Null) {
        object.remove("default");
    }
}
