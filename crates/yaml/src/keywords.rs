//! Which keywords of JSON schema are understood: those that our schemas have.

use serde_json::Value;

/// Keywords that describe and demand nothing; `x-min` and its like belong to `x-quantity`.
const DESCRIBING: [&str; 10] = [
    "$schema",
    "title",
    "description",
    "examples",
    "default",
    "format",
    "x-min",
    "x-max",
    "x-above",
    "x-removed",
];

/// Keywords that are checked.
const CHECKED: [&str; 21] = [
    "type",
    "enum",
    "const",
    "pattern",
    "minLength",
    "minimum",
    "maximum",
    "exclusiveMinimum",
    "exclusiveMaximum",
    "minItems",
    "maxItems",
    "uniqueItems",
    "items",
    "minProperties",
    "maxProperties",
    "properties",
    "required",
    "additionalProperties",
    "anyOf",
    "oneOf",
    "x-quantity",
];

/// Keywords of a schema, at any depth, that the check does not understand.
pub(crate) fn unknown_keywords(schema: &Value) -> Vec<String> {
    let Some(object) = schema.as_object() else { return Vec::new() };
    let mut unknown = Vec::new();
    for (keyword, argument) in object {
        let keyword = keyword.as_str();
        if !DESCRIBING.contains(&keyword) && !CHECKED.contains(&keyword) {
            unknown.push(keyword.to_owned());
        }
        match (keyword, argument) {
            ("properties", Value::Object(properties)) => {
                unknown.extend(properties.values().flat_map(unknown_keywords));
            }
            ("anyOf" | "oneOf", Value::Array(branches)) => {
                unknown.extend(branches.iter().flat_map(unknown_keywords));
            }
            ("items" | "additionalProperties", inner) => unknown.extend(unknown_keywords(inner)),
            _ => {}
        }
    }
    unknown
}
