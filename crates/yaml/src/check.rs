//! A JSON schema generated from a type, for editors, and every violation of it in a file as a finding at its position.
//!
//! serde would stop at the first mistake, and would lose position and choices for untagged enums and unknown keys.

use crate::document::positions::Tree;
use crate::document::positions::{Step, path_text};
use crate::rules::{Message, Rule, Violation, check_quantity, find_violations, name_of};
use crate::source::{Finding, FindingKind, Notes, closest, guess};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use serde_json::{Map, Value};
use std::collections::HashSet;

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

/// Maximum number of unknown keys of one mapping that are reported; finding the position of each takes time.
const UNKNOWN_KEYS_LIMIT: usize = 200;

impl Schema {
    /// Checks a document against the schema, quantities included, and notes every mistake.
    pub fn check(&self, tree: &Tree, notes: &mut Notes) {
        // Values with a finding are not checked again.
        let rejected = notes.list().iter().map(|finding| finding.span.start).collect();
        let mut check = Check { tree, notes, rejected };
        for violation in find_violations(&self.value, tree.value()) {
            check.report(&violation);
            if check.notes.is_full() {
                break;
            }
        }
    }
}

struct Check<'a> {
    tree: &'a Tree,
    notes: &'a mut Notes,
    rejected: HashSet<usize>,
}

impl Check<'_> {
    fn report(&mut self, violation: &Violation<'_>) {
        let Violation { steps, schema, value, rule } = violation;
        match rule {
            Rule::Quantity(message) => self.note(steps, message),
            // One mistake in a quantity violates type, range and kind: report it once.
            _ if check_quantity(schema, value).is_some() => {}
            Rule::UnknownKeys(keys) => self.report_unknown_keys(steps, keys, schema),
            Rule::MissingKey(key) => self.report_missing_key(steps, key, schema),
            Rule::NoForm(forms) => self.report_intended_form(steps, forms, schema, value),
            rule => {
                if let Some(message) = describe_violation(rule, schema, value) {
                    self.note(steps, &message);
                }
            }
        }
    }

    fn note(&mut self, steps: &[Step], Message { kind, message, remedy }: &Message) {
        self.push(self.tree.finding(*kind, steps, message, remedy));
    }

    fn push(&mut self, finding: Finding) {
        if !self.rejected.contains(&finding.span.start) {
            self.notes.push(finding);
        }
    }

    fn report_unknown_keys(&mut self, steps: &[Step], unexpected: &[&str], schema: &Map<String, Value>) {
        let known = keys_of(schema);
        let within = match path_text(steps) {
            path if path.is_empty() => format!("in a {}", self.tree.source().document.name),
            path => format!("in `{path}`"),
        };
        for key in unexpected.iter().take(UNKNOWN_KEYS_LIMIT) {
            let (message, remedy) = match replacement(schema, key) {
                Some(remedy) => (format!("the key `{key}` is no longer known {within}"), remedy.to_owned()),
                None => (
                    format!("there is no key `{}` {within}", shorten(key)),
                    format!("{}the keys are {}", guess(key, &known), known.join(", ")),
                ),
            };
            let full = [steps, &[Step::from(*key)]].concat();
            self.push(self.tree.key_finding(FindingKind::UnknownKey, &full, message, remedy));
        }
    }

    fn report_missing_key(&mut self, steps: &[Step], key: &str, schema: &Map<String, Value>) {
        let known = keys_of(schema);
        let is_mistyped = |present: &str| !known.contains(&present) && closest(present, &known) == Some(key);
        // A mistyped key is already reported as an unknown key.
        if self.tree.keys(steps).take(UNKNOWN_KEYS_LIMIT).any(is_mistyped) {
            return;
        }
        let property = schema.get("properties").and_then(|properties| properties.get(key));
        let within = match path_text(steps) {
            path if path.is_empty() => format!("the {}", self.tree.source().document.name),
            path => format!("`{path}`"),
        };
        let example = property.and_then(example_of).map_or(format!("{key}: ..."), |e| format!("{key}: {e}"));
        let message = Message {
            kind: FindingKind::MissingKey,
            message: format!("{within} has no key `{key}`"),
            remedy: with_description(format!("write e.g. `{example}`"), property.and_then(Value::as_object)),
        };
        self.note(steps, &message);
    }

    /// For alternative forms, reports the violations of the form with the same type, which was probably intended.
    fn report_intended_form(
        &mut self,
        steps: &[Step],
        forms: &[Vec<Violation<'_>>],
        schema: &Map<String, Value>,
        value: &Value,
    ) {
        let has_other_type = |violation: &Violation<'_>| {
            violation.steps.len() == steps.len() && matches!(violation.rule, Rule::Type)
        };
        let intended: Vec<_> = forms.iter().filter(|form| !form.iter().any(has_other_type)).collect();
        let names: Option<Vec<&str>> = intended
            .iter()
            .flat_map(|form| form.iter())
            .map(|violation| match &violation.rule {
                Rule::Names(names) => Some(names.as_slice()),
                _ => None,
            })
            .collect::<Option<Vec<_>>>()
            .map(|lists| lists.concat());
        match (names, intended.as_slice()) {
            // The description of the whole is more helpful than that of the list of names.
            (Some(names), [_, ..]) => self.note(steps, &wrong_name(&names, schema, value)),
            (_, [form]) => form.iter().for_each(|violation| self.report(violation)),
            _ => {
                let message = Message {
                    kind: FindingKind::WrongType,
                    message: format!("{} is not one of the forms allowed here", quote(value)),
                    remedy: with_description(example_sentence(schema), Some(schema)),
                };
                self.note(steps, &message);
            }
        }
    }
}

/// The message for a violated rule about a value itself; `None` for rules about keys and alternative forms, which need other positions.
fn describe_violation(rule: &Rule<'_>, schema: &Map<String, Value>, value: &Value) -> Option<Message> {
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
fn wrong_name(options: &[&str], schema: &Map<String, Value>, value: &Value) -> Message {
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
fn replacement<'a>(schema: &'a Map<String, Value>, name: &str) -> Option<&'a str> {
    schema.get("x-removed")?.get(name)?.as_str()
}

/// The allowed keys of a mapping.
fn keys_of(schema: &Map<String, Value>) -> Vec<&str> {
    let properties = schema.get("properties").and_then(Value::as_object);
    properties.map(|properties| properties.keys().map(String::as_str).collect()).unwrap_or_default()
}

/// The example of a schema, or one that combines the examples of its required keys.
fn example_of(schema: &Value) -> Option<String> {
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
fn example_sentence(schema: &Map<String, Value>) -> String {
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
fn with_description(remedy: String, schema: Option<&Map<String, Value>>) -> String {
    match schema.and_then(|schema| schema.get("description")).and_then(Value::as_str) {
        Some(description) => format!("{remedy}. {description}"),
        None => remedy,
    }
}

/// A value for a message.
fn quote(value: &Value) -> String {
    match value {
        Value::String(text) => format!("`{}`", shorten(text)),
        Value::Null => "nothing".to_owned(),
        Value::Array(_) | Value::Object(_) => name_of(value).to_owned(),
        other => format!("`{other}`"),
    }
}

/// Shortens a text for a message, and replaces its control characters.
fn shorten(text: &str) -> String {
    let clean: String = text.chars().take(60).map(|c| if c.is_control() { '?' } else { c }).collect();
    if text.chars().count() > 60 { format!("{clean}...") } else { clean }
}
