//! Messages of the violated rules.

use crate::finding::{FindingKind, guess};
use crate::rules::{Message, Rule, name_of};
use serde_json::{Map, Value};

/// The message for a violated rule about a value itself; `None` for rules about keys and alternative forms, which need other positions.
pub(crate) fn describe_violation(
    rule: &Rule<'_>,
    schema: &Map<String, Value>,
    value: &Value,
) -> Option<Message> {
    let range = |message: String, remedy: String| Message { kind: FindingKind::Range, message, remedy };
    let bound = |message: &str, bound: String| {
        range(format!("{value} is too {message}"), with_description(bound, Some(schema)))
    };
    let noun = if value.is_array() { "list" } else { "mapping" };
    Some(match rule {
        Rule::Type => wrong_type(schema, value),
        Rule::Names(names) => wrong_name(names, schema, value),
        Rule::Pattern => Message {
            kind: FindingKind::WrongValue,
            message: format!("{} is not of the form needed", quote(value)),
            remedy: with_description(example_sentence(schema), Some(schema)),
        },
        Rule::Minimum(limit) => bound("low", format!("it must be at least {limit}")),
        Rule::Maximum(limit) => bound("high", format!("it must be at most {limit}")),
        Rule::ExclusiveMinimum(limit) => bound("low", format!("it must be above {limit}")),
        Rule::ExclusiveMaximum(limit) => bound("high", format!("it must be below {limit}")),
        Rule::TooShort => {
            let remedy = with_description(example_sentence(schema), Some(schema));
            let empty = value.as_array().is_none_or(Vec::is_empty);
            range(format!("the {noun} {}", if empty { "is empty" } else { "is too short" }), remedy)
        }
        Rule::TooLong(limit) if value.is_array() => {
            let remedy = with_description(format!("it must have at most {limit} entries"), Some(schema));
            range("the list is too long".to_owned(), remedy)
        }
        Rule::TooLong(limit) => {
            let exactly = schema.get("minProperties") == Some(limit);
            let count = if exactly { "exactly" } else { "at most" };
            let remedy = with_description(format!("it must have {count} {limit}"), Some(schema));
            range("the mapping has too many keys".to_owned(), remedy)
        }
        Rule::Repeated => Message {
            kind: FindingKind::Duplicate,
            message: "an entry appears twice".to_owned(),
            remedy: "remove one of the two".to_owned(),
        },
        Rule::SeveralForms => Message {
            kind: FindingKind::WrongValue,
            message: format!("{} has more than one meaning here", quote(value)),
            remedy: with_description(example_sentence(schema), Some(schema)),
        },
        Rule::UnknownKeyword(keyword) => Message {
            kind: FindingKind::Unsupported,
            message: format!("the program's own schema has the unknown keyword `{keyword}`"),
            remedy: "this is a fault of the program; please report it".to_owned(),
        },
        Rule::UnknownKeys(_) | Rule::MissingKey(_) | Rule::NoForm(_) | Rule::Quantity(_) => return None,
    })
}

fn wrong_type(schema: &Map<String, Value>, value: &Value) -> Message {
    let names = match schema.get("type") {
        Some(Value::Array(names)) => names.as_slice(),
        Some(name) => std::slice::from_ref(name),
        None => &[],
    };
    let needed: Vec<&str> = names.iter().filter_map(Value::as_str).map(type_name).collect();
    let needed = needed.join(" or ");
    let remedy = match value {
        Value::Null => format!("{}, or remove the key", example_sentence(schema)),
        Value::Number(number) if needed == "text" => format!("put it into quotes: `\"{number}\"`"),
        _ => example_sentence(schema),
    };
    Message {
        kind: FindingKind::WrongType,
        message: match value {
            Value::Null => "there is no value".into(),
            Value::Array(_) | Value::Object(_) => {
                format!("{} is given where {needed} is needed", name_of(value))
            }
            _ => format!("{} is {}, but {needed} is needed", quote(value), name_of(value)),
        },
        remedy: with_description(remedy, Some(schema)),
    }
}

fn type_name(name: &str) -> &'static str {
    match name {
        "object" => "a mapping",
        "array" => "a list",
        "number" => "a plain number",
        "integer" => "a whole number",
        "string" => "text",
        "boolean" => "true or false",
        _ => "nothing",
    }
}

/// The message for a name that is not allowed.
pub(crate) fn wrong_name(options: &[&str], schema: &Map<String, Value>, value: &Value) -> Message {
    if let Some(replacement) = value.as_str().and_then(|name| replacement(schema, name)) {
        let message = format!("{} is no longer known", quote(value));
        return Message { kind: FindingKind::WrongValue, message, remedy: replacement.to_owned() };
    }
    let guess = value.as_str().map(|text| guess(text, options)).unwrap_or_default();
    Message {
        kind: FindingKind::WrongValue,
        message: format!("{} is not one of {}", quote(value), options.join(", ")),
        remedy: with_description(format!("{guess}write one of {}", options.join(", ")), Some(schema)),
    }
}

/// The replacement of a key or a name of earlier versions, from the keyword `x-removed` of its schema.
pub(crate) fn replacement<'a>(schema: &'a Map<String, Value>, name: &str) -> Option<&'a str> {
    schema.get("x-removed")?.get(name)?.as_str()
}

/// The allowed keys of a mapping.
pub(crate) fn keys_of(schema: &Map<String, Value>) -> Vec<&str> {
    let properties = schema.get("properties").and_then(Value::as_object);
    properties.map(|properties| properties.keys().map(String::as_str).collect()).unwrap_or_default()
}

/// The example of a schema, or one that combines the examples of its required keys.
pub(crate) fn example_of(schema: &Value) -> Option<String> {
    if let Some(example) = schema.get("examples").and_then(|list| list.get(0)) {
        return Some(example.as_str().map_or_else(|| example.to_string(), str::to_owned));
    }
    // The first of several alternative forms that has an example.
    if let Some(forms) = schema.get("anyOf").and_then(Value::as_array) {
        return forms.iter().find_map(example_of);
    }
    let properties = schema.get("properties")?;
    let required: Option<Vec<String>> = schema
        .get("required")?
        .as_array()?
        .iter()
        .map(|key| Some(format!("{}: {}", key.as_str()?, example_of(properties.get(key.as_str()?)?)?)))
        .collect();
    Some(format!("{{{}}}", required?.join(", ")))
}

/// A remedy with the example of the schema.
pub(crate) fn example_sentence(schema: &Map<String, Value>) -> String {
    let example = schema.get("examples").and_then(|list| list.get(0));
    let example = example.map(|e| e.as_str().map_or_else(|| e.to_string(), str::to_owned));
    match (example, schema.get("properties").and_then(Value::as_object)) {
        (Some(example), _) => format!("write e.g. `{example}`"),
        (None, Some(properties)) => {
            format!(
                "write a mapping with the keys {}",
                properties.keys().cloned().collect::<Vec<_>>().join(", ")
            )
        }
        (None, None) => "write a value of the form described".to_owned(),
    }
}

/// Appends the description of the schema to a remedy.
pub(crate) fn with_description(remedy: String, schema: Option<&Map<String, Value>>) -> String {
    match schema.and_then(|schema| schema.get("description")).and_then(Value::as_str) {
        Some(description) => format!("{remedy}. {description}"),
        None => remedy,
    }
}

/// A value for a message.
pub(crate) fn quote(value: &Value) -> String {
    match value {
        Value::String(text) => format!("`{}`", shorten(text)),
        Value::Null => "nothing".to_owned(),
        Value::Array(_) | Value::Object(_) => name_of(value).to_owned(),
        other => format!("`{other}`"),
    }
}

/// Shortens a text for a message, and replaces its control characters.
pub(crate) fn shorten(text: &str) -> String {
    let clean: String = text.chars().take(60).map(|c| if c.is_control() { '?' } else { c }).collect();
    if text.chars().count() > 60 { format!("{clean}...") } else { clean }
}
