//! Checks a quantity against kind and range of its schema.

use crate::mistakes::finding::FindingKind;
use crate::units::{Kind, parse};
use serde_json::{Map, Value};

/// A mistake and its remedy, without a position.
#[derive(Debug, Clone)]
pub(crate) struct Message {
    pub kind: FindingKind,
    pub message: String,
    pub remedy: String,
}

/// Checks a value against `x-quantity`, `x-min`, `x-max` and `x-above` of its schema.
pub(crate) fn check(schema: &Map<String, Value>, value: &Value) -> Option<Message> {
    let kind = schema.get("x-quantity").and_then(Value::as_str).and_then(Kind::from_key)?;
    let example = schema.get("examples").and_then(|list| list.get(0)).and_then(Value::as_str);
    let example = example.unwrap_or_else(|| kind.example());
    let text = match value {
        Value::String(text) => text.clone(),
        // A bare number is a quantity without its unit.
        Value::Number(number) => number.to_string(),
        Value::Null => {
            return Some(Message {
                kind: FindingKind::WrongType,
                message: "there is no value".into(),
                remedy: format!("write {}, e.g. `{example}`, or remove the key", kind.name()),
            });
        }
        _ => {
            return Some(Message {
                kind: FindingKind::WrongType,
                message: format!("{} is given where {} is needed", name_of(value), kind.name()),
                remedy: format!("write e.g. `{example}` (units: {})", kind.unit_list()),
            });
        }
    };
    let inside = match parse(kind, &text) {
        Ok(inside) => inside,
        Err(error) => {
            return Some(Message {
                kind: FindingKind::Unit,
                message: error.to_string(),
                remedy: error.remedy(kind),
            });
        }
    };
    let limit = |key: &str| {
        let text = schema.get(key)?.as_str()?;
        Some((parse(kind, text).ok()?, text.to_owned()))
    };
    let (low, high, above) = (limit("x-min"), limit("x-max"), limit("x-above"));
    let too_low = low.as_ref().is_some_and(|(low, _)| inside < *low)
        || above.as_ref().is_some_and(|(above, _)| inside <= *above);
    let too_high = high.as_ref().is_some_and(|(high, _)| inside > *high);
    if !too_low && !too_high {
        return None;
    }
    let mut bounds = Vec::new();
    bounds.extend(low.map(|(_, text)| format!("at least {text}")));
    bounds.extend(above.map(|(_, text)| format!("above {text}")));
    bounds.extend(high.map(|(_, text)| format!("at most {text}")));
    Some(Message {
        kind: FindingKind::Range,
        message: format!("`{text}` is too {}", if too_low { "low" } else { "high" }),
        remedy: format!("it must be {}", bounds.join(" and ")),
    })
}

/// The name of a value's type in messages.
pub(crate) fn name_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "nothing",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "text",
        Value::Array(_) => "a list",
        Value::Object(_) => "a mapping",
    }
}
