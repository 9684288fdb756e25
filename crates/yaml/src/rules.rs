//! Checks a value against a JSON schema and returns every violation.
//!
//! Supports the keywords of schemas that are generated from our own types; any other keyword is a violation. Tests compare the
//! verdict with that of a complete validator.

use crate::document::positions::Step;
use crate::source::FindingKind;

use crate::units::{Kind, parse};
use serde_json::{Map, Value};
use std::collections::HashSet;

/// A value that violates a schema, or a missing one.
#[derive(Debug)]
pub(crate) struct Violation<'a> {
    /// The value's place.
    pub steps: Vec<Step>,
    /// The schema with the violated rule.
    pub schema: &'a Map<String, Value>,
    /// The value.
    pub value: &'a Value,
    pub rule: Rule<'a>,
}

/// The rule that is violated, with its bound.
#[derive(Debug)]
pub(crate) enum Rule<'a> {
    Type,
    /// The allowed names.
    Names(Vec<&'a str>),
    Pattern,
    Minimum(&'a Value),
    Maximum(&'a Value),
    ExclusiveMinimum(&'a Value),
    ExclusiveMaximum(&'a Value),
    /// Fewer entries than needed, or too short a text.
    TooShort,
    TooLong(&'a Value),
    Repeated,
    UnknownKeys(Vec<&'a str>),
    MissingKey(&'a str),
    /// None of several alternative forms fits, with the violations of each.
    NoForm(Vec<Vec<Violation<'a>>>),
    /// More than one form fits, but exactly one must.
    SeveralForms,
    Quantity(Message),
    /// An unsupported keyword: a defect of the program.
    UnknownKeyword(&'a str),
}

/// Keywords that are checked elsewhere, or that do not apply to a value of this type.
const KNOWN: [&str; 21] = [
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
    "items",
    "properties",
    "required",
    "additionalProperties",
    "anyOf",
    "oneOf",
    "pattern",
    "minItems",
    "maxItems",
    "minProperties",
    "maxProperties",
];

pub(crate) fn find_violations<'a>(schema: &'a Value, value: &'a Value) -> Vec<Violation<'a>> {
    let mut walk = Walk { steps: Vec::new(), violations: Vec::new() };
    walk.check(schema, value);
    walk.violations
}

struct Walk<'a> {
    steps: Vec<Step>,
    violations: Vec<Violation<'a>>,
}

impl<'a> Walk<'a> {
    fn check(&mut self, schema: &'a Value, value: &'a Value) {
        let schema = match schema {
            Value::Object(schema) => schema,
            // `true` allows everything, and `false` occurs only at `additionalProperties`.
            _ => return,
        };
        for (keyword, argument) in schema {
            if let Some(rule) = check_keyword(keyword, argument, schema, value) {
                self.note(schema, value, rule);
            }
        }
        self.check_forms(schema, value);
        match value {
            Value::Array(items) => self.check_items(schema, items),
            Value::Object(entries) => self.check_entries(schema, value, entries),
            _ => {}
        }
    }

    fn note(&mut self, schema: &'a Map<String, Value>, value: &'a Value, rule: Rule<'a>) {
        self.violations.push(Violation { steps: self.steps.clone(), schema, value, rule });
    }

    fn check_child(&mut self, step: Step, schema: &'a Value, value: &'a Value) {
        self.steps.push(step);
        self.check(schema, value);
        self.steps.pop();
    }

    fn check_items(&mut self, schema: &'a Map<String, Value>, items: &'a [Value]) {
        let Some(inner) = schema.get("items") else { return };
        for (index, item) in items.iter().enumerate() {
            self.check_child(Step::Index(index), inner, item);
        }
    }

    fn check_entries(
        &mut self,
        schema: &'a Map<String, Value>,
        value: &'a Value,
        entries: &'a Map<String, Value>,
    ) {
        let properties = schema.get("properties").and_then(Value::as_object);
        let others = schema.get("additionalProperties");
        let mut unknown = Vec::new();
        for (key, value) in entries {
            let inner = properties.and_then(|properties| properties.get(key)).or(others);
            match inner {
                Some(Value::Bool(false)) => unknown.push(key.as_str()),
                Some(inner) => self.check_child(Step::Key(key.clone()), inner, value),
                None => {}
            }
        }
        if !unknown.is_empty() {
            self.note(schema, value, Rule::UnknownKeys(unknown));
        }
        let required = schema.get("required").and_then(Value::as_array).into_iter().flatten();
        for key in required.filter_map(Value::as_str).filter(|key| !entries.contains_key(*key)) {
            self.note(schema, value, Rule::MissingKey(key));
        }
    }

    fn check_forms(&mut self, schema: &'a Map<String, Value>, value: &'a Value) {
        for (keyword, exactly_one) in [("anyOf", false), ("oneOf", true)] {
            let Some(forms) = schema.get(keyword).and_then(Value::as_array) else { continue };
            let mut tried = Vec::new();
            for form in forms {
                let mut walk = Walk { steps: self.steps.clone(), violations: Vec::new() };
                walk.check(form, value);
                tried.push(walk.violations);
            }
            match tried.iter().filter(|violations| violations.is_empty()).count() {
                0 => self.note(schema, value, Rule::NoForm(tried)),
                1 => {}
                _ if exactly_one => self.note(schema, value, Rule::SeveralForms),
                _ => {}
            }
        }
    }
}

/// Checks one keyword that does not concern the entries of the value.
fn check_keyword<'a>(
    keyword: &'a str,
    argument: &'a Value,
    schema: &Map<String, Value>,
    value: &'a Value,
) -> Option<Rule<'a>> {
    let number = value.as_f64();
    let length = match value {
        Value::Array(items) => Some(items.len()),
        Value::Object(entries) => Some(entries.len()),
        _ => None,
    };
    let beyond =
        |wrong: fn(f64, f64) -> bool| number.zip(argument.as_f64()).is_some_and(|(v, l)| wrong(v, l));
    let count = argument.as_u64().and_then(|count| usize::try_from(count).ok());
    let fewer = |length: Option<usize>| length.zip(count).is_some_and(|(length, count)| length < count);
    let more = |length: Option<usize>| length.zip(count).is_some_and(|(length, count)| length > count);
    match keyword {
        "type" => (!is_of_type(argument, value)).then_some(Rule::Type),
        "enum" => {
            let names = argument.as_array()?;
            (!names.contains(value)).then(|| Rule::Names(names.iter().filter_map(Value::as_str).collect()))
        }
        "const" => (argument != value).then(|| Rule::Names(argument.as_str().into_iter().collect())),
        // The pattern of a quantity is for editors only; the parser checks the value.
        "pattern" if !schema.contains_key("x-quantity") => {
            let pattern = regex_lite::Regex::new(argument.as_str()?).ok()?;
            value.as_str().is_some_and(|text| !pattern.is_match(text)).then_some(Rule::Pattern)
        }
        "minLength" => fewer(value.as_str().map(|text| text.chars().count())).then_some(Rule::Pattern),
        "minimum" => beyond(|value, limit| value < limit).then_some(Rule::Minimum(argument)),
        "maximum" => beyond(|value, limit| value > limit).then_some(Rule::Maximum(argument)),
        "exclusiveMinimum" => {
            beyond(|value, limit| value <= limit).then_some(Rule::ExclusiveMinimum(argument))
        }
        "exclusiveMaximum" => {
            beyond(|value, limit| value >= limit).then_some(Rule::ExclusiveMaximum(argument))
        }
        "minItems" if value.is_array() => fewer(length).then_some(Rule::TooShort),
        "maxItems" if value.is_array() => more(length).then_some(Rule::TooLong(argument)),
        "minProperties" if value.is_object() => fewer(length).then_some(Rule::TooShort),
        "maxProperties" if value.is_object() => more(length).then_some(Rule::TooLong(argument)),
        "uniqueItems" => {
            let mut seen = HashSet::new();
            let mut items = value.as_array().filter(|_| argument == &Value::Bool(true))?.iter();
            items.any(|item| !seen.insert(key_of(item))).then_some(Rule::Repeated)
        }
        "x-quantity" => check_quantity(schema, value).map(Rule::Quantity),
        keyword if KNOWN.contains(&keyword) => None,
        keyword => Some(Rule::UnknownKeyword(keyword)),
    }
}

/// A text that identifies a value: 1 and 1.0 are equal.
fn key_of(item: &Value) -> String {
    match item.as_f64() {
        Some(number) => number.to_string(),
        None => item.to_string(),
    }
}

fn is_of_type(argument: &Value, value: &Value) -> bool {
    match argument {
        Value::String(name) => is_named(name, value),
        Value::Array(names) => names.iter().filter_map(Value::as_str).any(|name| is_named(name, value)),
        _ => true,
    }
}

fn is_named(name: &str, value: &Value) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "number" => value.is_number(),
        // For a JSON schema 1.0 is a whole number.
        "integer" => value.is_i64() || value.is_u64() || value.as_f64().is_some_and(|v| v.fract() == 0.0),
        _ => false,
    }
}

/// A mistake and its remedy, without a position.
#[derive(Debug, Clone)]
pub(crate) struct Message {
    pub kind: FindingKind,
    pub message: String,
    pub remedy: String,
}

/// Checks a value against `x-quantity`, `x-min`, `x-max` and `x-above` of its schema.
pub(crate) fn check_quantity(schema: &Map<String, Value>, value: &Value) -> Option<Message> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    /// Every keyword that is checked, but for the quantities, which are our own.
    fn schema() -> Value {
        json!({
            "type": "object",
            "required": ["name"],
            "minProperties": 2,
            "maxProperties": 5,
            "additionalProperties": false,
            "properties": {
                "name": {"type": "string", "minLength": 2, "pattern": "^[a-zµ]+$"},
                "mode": {"type": "string", "enum": ["auto", "fixed"]},
                "kind": {"const": "a"},
                "share": {"type": "number", "minimum": 0, "exclusiveMaximum": 1},
                "count": {"type": "integer", "exclusiveMinimum": 0, "maximum": 3},
                "list": {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 1, "maxItems": 3, "uniqueItems": true},
                "either": {"anyOf": [{"type": "string", "enum": ["off"]}, {"type": "object", "additionalProperties": {"type": "boolean"}}]},
                "one": {"oneOf": [{"type": "number", "minimum": 1}, {"type": "number", "maximum": 2}]},
            },
        })
    }

    /// Values that are often right at one of the keys above, and often not.
    fn value() -> impl Strategy<Value = Value> {
        let scalar = prop_oneof![
            Just(json!(null)),
            any::<bool>().prop_map(Value::from),
            (-2i64..5).prop_map(Value::from),
            (-4i32..8).prop_map(|n| json!(f64::from(n) / 2.0)),
            prop::sample::select(vec!["", "a", "ab", "µm", "Ab", "auto", "fixed", "off"])
                .prop_map(Value::from),
        ];
        let keys = prop::sample::select(vec!["name", "on", "mode"]).prop_map(str::to_owned);
        scalar.prop_recursive(2, 8, 4, move |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
                prop::collection::hash_map(keys.clone(), inner, 0..3)
                    .prop_map(|entries| Value::Object(entries.into_iter().collect())),
            ]
        })
    }

    fn document() -> impl Strategy<Value = Value> {
        let keys = ["name", "mode", "kind", "share", "count", "list", "either", "one", "unknown"];
        let key = prop::sample::select(keys.to_vec()).prop_map(str::to_owned);
        let entries = prop::collection::hash_map(key, value(), 0..6);
        (entries, any::<bool>()).prop_map(|(mut entries, named)| {
            if named {
                entries.insert("name".to_owned(), json!("ab"));
            }
            Value::Object(entries.into_iter().collect())
        })
    }

    /// Whether a complete validator, by other hands, finds the value right.
    fn oracle() -> jsonschema::Validator {
        jsonschema::validator_for(&schema()).unwrap()
    }

    #[test]
    fn right_and_wrong_documents_are_judged_as_by_a_complete_validator() {
        let (schema, oracle) = (schema(), oracle());
        for (key, right, wrong) in [
            ("name", json!("ab"), json!("a")),
            ("mode", json!("auto"), json!("manual")),
            ("kind", json!("a"), json!("b")),
            ("share", json!(0), json!(1)),
            ("count", json!(3.0), json!(2.5)),
            ("list", json!([1, "1"]), json!([1, 1.0])),
            ("list", json!([1]), json!([])),
            ("list", json!([1, 2, 3]), json!([1, 2, 3, 4])),
            ("either", json!({"a": true}), json!({"a": 1})),
            ("either", json!("off"), json!("on")),
            ("one", json!(0), json!(1.5)),
        ] {
            for (value, valid) in [(right, true), (wrong, false)] {
                let document = json!({"name": "ab", "mode": "auto", key: value});
                assert_eq!(oracle.is_valid(&document), valid, "{document}");
                assert_eq!(find_violations(&schema, &document).is_empty(), valid, "{document}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn any_document_gets_the_verdict_of_a_complete_validator(document in document()) {
            thread_local! { static ORACLE: jsonschema::Validator = oracle(); }
            let valid = ORACLE.with(|oracle| oracle.is_valid(&document));
            let schema = schema();
            prop_assert_eq!(find_violations(&schema, &document).is_empty(), valid, "{}", document);
        }
    }
}
