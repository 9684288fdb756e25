//! The JSON schema of a campaign file.

use crate::campaign::CampaignFile;
use mapper_yaml::Schema;
use serde_json::Value;
use std::sync::LazyLock;

/// JSON schema (draft 2020-12) of a campaign file, for editors and other tools.
///
/// Quantities are strings; `x-quantity` names their kind, `x-min`, `x-max` and `x-above` their range.
pub fn json_schema() -> Value {
    mapper_yaml::json_schema_of::<CampaignFile>()
}

/// The schema, compiled once, for validation.
pub(crate) static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<CampaignFile>);

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_yaml::Source;
    use serde_json::Map;
    use std::path::Path;

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
                    "{key} has no description: {property}"
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
        // Validates as an editor does.
        let validator = jsonschema::validator_for(&json_schema()).unwrap();
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../campaigns/turbo_a.yaml");
        let text = std::fs::read_to_string(path).unwrap();
        let source = Source::new(&crate::files::load::DOCUMENT, Path::new(path), &text);
        let mut value = mapper_yaml::read(source).unwrap().0.value().clone();
        assert!(validator.is_valid(&value), "{:?}", validator.validate(&value));
        for (key, text, right) in
            [("dwell", "120 kg", false), ("dwell", "2 min", true), ("dwel", "2 min", false)]
        {
            value["timing"][key] = text.into();
            assert_eq!(validator.is_valid(&value), right, "{key}: {text}");
        }
    }
}
