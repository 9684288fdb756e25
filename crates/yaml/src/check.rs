//! A JSON schema generated from a type, for editors, and every violation of it in a file as a finding at its position.
//!
//! serde would stop at the first mistake, and would lose position and choices for untagged enums and unknown keys.

use crate::document::positions::{Step, path_text};
use crate::document::tree::Tree;
use crate::finding::{Finding, FindingKind, closest, guess};
use crate::messages::{
    describe_violation, example_of, example_sentence, keys_of, quote, replacement, shorten, with_description,
    wrong_name,
};
use crate::rules::{Message, Rule, Violation, check_quantity, find_violations};
use crate::source::Notes;
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
