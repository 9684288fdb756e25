//! The JSON schema: made from the file structs, given to editors, and what a file is checked against.

use crate::campaign::CampaignFile;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{Schema, generate::SchemaSettings};
use serde_json::{Map, Value};

/// JSON schema (draft 2020-12) of a campaign file, for editors and other tools.
///
/// Quantities are strings; `x-quantity` names their kind, `x-min`, `x-max` and `x-above` their range.
pub fn json_schema() -> Value {
    let mut settings = SchemaSettings::draft2020_12();
    // Without `$ref` a schema path leads straight to the description a message quotes.
    settings.inline_subschemas = true;
    settings.transforms.push(Box::new(WithoutNull));
    settings.into_generator().into_root_schema_for::<CampaignFile>().to_value()
}

/// A key that may be left out may still not be empty: takes `null` out of what `Option` allows.
#[derive(Debug, Clone)]
struct WithoutNull;

impl Transform for WithoutNull {
    fn transform(&mut self, schema: &mut Schema) {
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
    // What is assumed where a key is left out stands in its description, written as a file would have it.
    object.remove("default");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn visit(value: &Value, check: &mut impl FnMut(&Map<String, Value>)) {
        match value {
            Value::Object(object) => {
                check(object);
                object.values().for_each(|child| visit(child, check));
            }
            Value::Array(items) => items.iter().for_each(|child| visit(child, check)),
            _ => {}
        }
    }

    #[test]
    fn every_key_is_described_and_every_mapping_is_closed() {
        let schema = json_schema();
        visit(&schema, &mut |object| {
            let Some(Value::Object(properties)) = object.get("properties") else { return };
            assert_eq!(object.get("additionalProperties"), Some(&Value::Bool(false)), "{object:?}");
            for (key, property) in properties {
                let date =
                    property.get("pattern").is_some_and(|p| p.as_str().unwrap().starts_with("^[0-9]{4}"));
                assert!(
                    date || property.get("description").is_some(),
                    "{key} lacks a description: {property}"
                );
            }
        });
    }

    #[test]
    fn every_quantity_and_range_is_readable() {
        visit(&json_schema(), &mut |object| {
            let ranges = ["x-min", "x-max", "x-above"];
            let Some(key) = object.get("x-quantity") else {
                assert!(!ranges.iter().any(|range| object.contains_key(*range)), "{object:?}");
                return;
            };
            let kind = crate::units::Kind::from_key(key.as_str().unwrap()).unwrap();
            for range in ranges.iter().filter_map(|range| object.get(*range)) {
                crate::units::parse(kind, range.as_str().unwrap()).unwrap();
            }
            for example in object["examples"].as_array().unwrap() {
                crate::units::parse(kind, example.as_str().unwrap()).unwrap();
            }
        });
    }

    #[test]
    fn nothing_but_the_backends_own_settings_may_be_null() {
        visit(&json_schema(), &mut |object| {
            assert!(!object.get("type").is_some_and(|name| name.to_string().contains("null")), "{object:?}");
        });
    }

    #[test]
    fn a_validator_without_the_own_keyword_accepts_turbo_a_and_sees_mistakes() {
        // What an editor does.
        let validator = jsonschema::validator_for(&json_schema()).unwrap();
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../campaigns/turbo_a.yaml");
        let text = std::fs::read_to_string(path).unwrap();
        let mut value: Value = crate::deserialise::any(&text).unwrap();
        assert!(validator.is_valid(&value), "{:?}", validator.validate(&value));
        for (key, text, right) in
            [("dwell", "120 kg", false), ("dwell", "2 min", true), ("dwel", "2 min", false)]
        {
            value["timing"][key] = text.into();
            assert_eq!(validator.is_valid(&value), right, "{key}: {text}");
        }
    }
}
