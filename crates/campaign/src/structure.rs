//! The tree against the schema: every violation becomes a finding at its place.

use crate::finding::{FindingKind, Notes, Source};
use crate::quantity_check::{self, Complaint, name_of};
use crate::schema::json_schema;
use crate::tree::{Node, Step, path_text};
use jsonschema::{Keyword, ValidationError, Validator, error::ValidationErrorKind, paths::LocationSegment};
use serde_json::{Map, Value};
use std::collections::HashSet;
use std::ops::Range;
use std::sync::LazyLock;

/// Checks everything the schema says, quantities included.
pub(crate) fn check(source: &Source, root: &Node, notes: &mut Notes) {
    let rules = &*RULES;
    let validator = match &rules.validator {
        Ok(validator) => validator,
        Err(error) => {
            let message = format!("the program's own schema is broken: {error}");
            let remedy = "this is a fault of the program; please report it".to_owned();
            notes.push(source.finding(FindingKind::Unsupported, String::new(), 0..0, message, remedy));
            return;
        }
    };
    let instance = root.to_json();
    // What the tree refused is null here, and would be complained about a second time.
    let refused = notes.list.iter().map(|finding| finding.span.start).collect();
    let mut check = Check { source, root, schema: &rules.schema, notes, refused };
    for error in validator.iter_errors(&instance) {
        check.translate(&error);
        if check.notes.is_full() {
            break;
        }
    }
}

/// The schema and what was made of it, once.
struct Rules {
    schema: Value,
    validator: Result<Validator, String>,
}

static RULES: LazyLock<Rules> = LazyLock::new(|| {
    let schema = json_schema();
    let validator = jsonschema::options()
        .with_keyword("x-quantity", |parent: &Map<String, Value>, _: &Value, _| {
            Ok(Box::new(QuantityKeyword { schema: parent.clone() }) as Box<dyn for<'i> Keyword<'i>>)
        })
        .build(&schema)
        .map_err(|error| error.to_string());
    Rules { schema, validator }
});

/// Unknown keys of one mapping that are reported; looking up the place of each takes time.
const UNKNOWN_KEYS_LIMIT: usize = 200;

struct QuantityKeyword {
    schema: Map<String, Value>,
}

impl<'i> Keyword<'i> for QuantityKeyword {
    fn validate(&self, instance: &'i Value) -> Result<(), ValidationError<'i>> {
        match quantity_check::check(&self.schema, instance) {
            None => Ok(()),
            Some(complaint) => Err(ValidationError::custom(complaint.message)),
        }
    }

    fn is_valid(&self, instance: &'i Value) -> bool {
        quantity_check::check(&self.schema, instance).is_none()
    }
}

struct Check<'a> {
    source: &'a Source,
    root: &'a Node,
    schema: &'a Value,
    notes: &'a mut Notes,
    refused: HashSet<usize>,
}

impl Check<'_> {
    fn translate(&mut self, error: &ValidationError<'_>) {
        let steps: Vec<Step> = error.instance_path().segments().map(step).collect();
        // The schema object that holds the violated keyword.
        let schema_path = error.schema_path().as_str();
        let parent = schema_path.rsplit_once('/').map_or("", |(parent, _)| parent);
        let empty = Map::new();
        let schema = self.schema.pointer(parent).and_then(Value::as_object).unwrap_or(&empty);
        let value = error.instance();
        if let Some(complaint) = quantity_check::check(schema, value) {
            // Type, pattern and kind all fail for one mistake.
            if error.kind().keyword() == "x-quantity" {
                self.note(&steps, complaint);
            }
            return;
        }
        match error.kind() {
            ValidationErrorKind::AdditionalProperties { unexpected } => {
                self.unknown_keys(&steps, unexpected, schema);
            }
            ValidationErrorKind::Required { property } => {
                self.missing_key(&steps, property.as_str().unwrap_or_default(), schema);
            }
            ValidationErrorKind::AnyOf { context } | ValidationErrorKind::OneOfNotValid { context } => {
                self.best_branch(&steps, context, schema, value);
            }
            kind => {
                if let Some(complaint) = complain(kind, schema, value) {
                    self.note(&steps, complaint);
                }
            }
        }
    }

    fn note(&mut self, steps: &[Step], complaint: Complaint) {
        let place = self.root.place(steps);
        self.note_at(steps, place, complaint);
    }

    fn note_at(&mut self, steps: &[Step], place: Range<usize>, complaint: Complaint) {
        let Complaint { kind, message, remedy } = complaint;
        let finding = self.source.finding(kind, path_text(steps), place, message, remedy);
        if !self.refused.contains(&finding.span.start) {
            self.notes.push(finding);
        }
    }

    fn unknown_keys(&mut self, steps: &[Step], unexpected: &[String], schema: &Map<String, Value>) {
        let known = keys_of(schema);
        for key in unexpected.iter().take(UNKNOWN_KEYS_LIMIT) {
            let within = match path_text(steps) {
                path if path.is_empty() => "in a campaign".to_owned(),
                path => format!("in `{path}`"),
            };
            let mut full: Vec<Step> = steps.to_vec();
            full.push(Step::Key(key.clone()));
            let guess =
                closest(key, &known).map(|guess| format!("did you mean `{guess}`? ")).unwrap_or_default();
            let complaint = Complaint {
                kind: FindingKind::UnknownKey,
                message: format!("there is no key `{}` {within}", shortened(key)),
                remedy: format!("{guess}the keys are {}", known.join(", ")),
            };
            let place = self.root.key_place(steps, key);
            self.note_at(&full, place, complaint);
        }
    }

    fn missing_key(&mut self, steps: &[Step], key: &str, schema: &Map<String, Value>) {
        let known = keys_of(schema);
        let there = self.root.get(steps).map(Node::entries).unwrap_or_default();
        let mistyped = |entry: &crate::tree::Entry| {
            !known.contains(&entry.key.as_str()) && closest(&entry.key, &known) == Some(key)
        };
        // A mistyped key is one mistake, complained about as an unknown key.
        if there.iter().take(UNKNOWN_KEYS_LIMIT).any(mistyped) {
            return;
        }
        let property = schema.get("properties").and_then(|properties| properties.get(key));
        let within = match path_text(steps) {
            path if path.is_empty() => "the campaign".to_owned(),
            path => format!("`{path}`"),
        };
        let example = property.and_then(example_of).map_or(format!("{key}: ..."), |e| format!("{key}: {e}"));
        let complaint = Complaint {
            kind: FindingKind::MissingKey,
            message: format!("{within} lacks the key `{key}`"),
            remedy: with_description(format!("write e.g. `{example}`"), property.and_then(Value::as_object)),
        };
        self.note(steps, complaint);
    }

    /// Of several forms a value may take, complains about the one that was meant: the one of the same type.
    fn best_branch(
        &mut self,
        steps: &[Step],
        context: &[Vec<ValidationError<'static>>],
        schema: &Map<String, Value>,
        value: &Value,
    ) {
        let depth = |error: &ValidationError<'_>| error.instance_path().segments().count();
        let meant: Vec<&Vec<ValidationError<'static>>> = context
            .iter()
            .filter(|branch| {
                !branch.iter().any(|error| {
                    depth(error) == steps.len() && matches!(error.kind(), ValidationErrorKind::Type { .. })
                })
            })
            .collect();
        let [branch] = meant.as_slice() else {
            let complaint = Complaint {
                kind: FindingKind::WrongType,
                message: format!("{} is none of the forms allowed here", quoted(value)),
                remedy: with_description(example_sentence(schema), Some(schema)),
            };
            self.note(steps, complaint);
            return;
        };
        let lists = branch.iter().all(|error| matches!(error.kind(), ValidationErrorKind::Enum { .. }));
        if lists {
            // The description of the whole says more than that of the list of names.
            let options = branch.iter().find_map(|error| match error.kind() {
                ValidationErrorKind::Enum { options } => Some(names(options)),
                _ => None,
            });
            let complaint = wrong_name(&options.unwrap_or_default(), schema, value);
            self.note(steps, complaint);
            return;
        }
        for error in branch.iter() {
            self.translate(error);
        }
    }
}

fn step(segment: LocationSegment<'_>) -> Step {
    match segment {
        LocationSegment::Property(key) => Step::Key(key.into_owned()),
        LocationSegment::Index(index) => Step::Index(index),
    }
}

fn complain(kind: &ValidationErrorKind, schema: &Map<String, Value>, value: &Value) -> Option<Complaint> {
    let range = |message: String, bound: String| Complaint {
        kind: FindingKind::Range,
        message,
        remedy: with_description(bound, Some(schema)),
    };
    Some(match kind {
        ValidationErrorKind::Type { .. } => wrong_type(schema, value),
        ValidationErrorKind::Enum { options } => wrong_name(&names(options), schema, value),
        // A wrong type is complained about once.
        ValidationErrorKind::Pattern { .. } | ValidationErrorKind::MinLength { .. } => Complaint {
            kind: FindingKind::WrongValue,
            message: format!("{} is not of the form needed", quoted(value)),
            remedy: with_description(example_sentence(schema), Some(schema)),
        },
        ValidationErrorKind::Minimum { limit } => {
            range(format!("{value} is too low"), format!("it must be at least {limit}"))
        }
        ValidationErrorKind::Maximum { limit } => {
            range(format!("{value} is too high"), format!("it must be at most {limit}"))
        }
        ValidationErrorKind::ExclusiveMinimum { limit } => {
            range(format!("{value} is too low"), format!("it must be above {limit}"))
        }
        ValidationErrorKind::ExclusiveMaximum { limit } => {
            range(format!("{value} is too high"), format!("it must be below {limit}"))
        }
        ValidationErrorKind::MinItems { .. } => range("the list is empty".into(), example_sentence(schema)),
        ValidationErrorKind::MaxItems { limit } => {
            range("the list is too long".into(), format!("it must have at most {limit} entries"))
        }
        ValidationErrorKind::MinProperties { .. } => {
            range("the mapping is empty".into(), example_sentence(schema))
        }
        ValidationErrorKind::MaxProperties { limit } => {
            range("the mapping has too many keys".into(), format!("it must have exactly {limit}"))
        }
        ValidationErrorKind::UniqueItems => Complaint {
            kind: FindingKind::Duplicate,
            message: "an entry stands twice".into(),
            remedy: "remove one of the two".into(),
        },
        other => Complaint {
            kind: FindingKind::WrongValue,
            message: format!("{} violates the rule `{}`", quoted(value), other.keyword()),
            remedy: with_description(example_sentence(schema), Some(schema)),
        },
    })
}

fn wrong_type(schema: &Map<String, Value>, value: &Value) -> Complaint {
    let needed = match schema.get("type").and_then(Value::as_str).unwrap_or_default() {
        "object" => "a mapping",
        "array" => "a list",
        "number" => "a plain number",
        "integer" => "a whole number",
        "string" => "text",
        _ => "something else",
    };
    let remedy = match value {
        Value::Null => format!("{}, or remove the key", example_sentence(schema)),
        Value::Number(number) if needed == "text" => format!("put it into quotes: `\"{number}\"`"),
        _ => example_sentence(schema),
    };
    Complaint {
        kind: FindingKind::WrongType,
        message: match value {
            Value::Null => "there is no value".into(),
            Value::Array(_) | Value::Object(_) => {
                format!("{} stands where {needed} is needed", name_of(value))
            }
            _ => format!("{} is {}, but {needed} is needed", quoted(value), name_of(value)),
        },
        remedy: with_description(remedy, Some(schema)),
    }
}

fn wrong_name(options: &[&str], schema: &Map<String, Value>, value: &Value) -> Complaint {
    let guess = value
        .as_str()
        .and_then(|text| closest(text, options))
        .map(|guess| format!("did you mean `{guess}`? "))
        .unwrap_or_default();
    Complaint {
        kind: FindingKind::WrongValue,
        message: format!("{} is none of {}", quoted(value), options.join(", ")),
        remedy: with_description(format!("{guess}write one of {}", options.join(", ")), Some(schema)),
    }
}

fn names(options: &Value) -> Vec<&str> {
    options.as_array().map(|list| list.iter().filter_map(Value::as_str).collect()).unwrap_or_default()
}

/// The candidate that a mistyped word most likely was: at most a third of its letters wrong, case aside.
fn closest<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // A word that long is no slip of the finger, and the distance costs its square.
    if word.len() > 64 {
        return None;
    }
    let lower = word.to_lowercase().replace('-', "_");
    candidates
        .iter()
        .map(|candidate| (strsim::osa_distance(&lower, &candidate.to_lowercase()), *candidate))
        .filter(|(distance, candidate)| {
            *distance <= (candidate.chars().count().max(lower.chars().count())).div_ceil(3)
        })
        .min()
        .map(|(_, candidate)| candidate)
}

fn keys_of(schema: &Map<String, Value>) -> Vec<&str> {
    let properties = schema.get("properties").and_then(Value::as_object);
    properties.map(|properties| properties.keys().map(String::as_str).collect()).unwrap_or_default()
}

/// The example of a schema, or one made of those of the keys it requires.
fn example_of(schema: &Value) -> Option<String> {
    if let Some(example) = schema.get("examples").and_then(|list| list.get(0)) {
        return Some(example.as_str().map_or_else(|| example.to_string(), str::to_owned));
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

fn with_description(remedy: String, schema: Option<&Map<String, Value>>) -> String {
    match schema.and_then(|schema| schema.get("description")).and_then(Value::as_str) {
        Some(description) => format!("{remedy}. {description}"),
        None => remedy,
    }
}

fn quoted(value: &Value) -> String {
    match value {
        Value::String(text) => format!("`{}`", shortened(text)),
        Value::Null => "nothing".to_owned(),
        Value::Array(_) | Value::Object(_) => name_of(value).to_owned(),
        other => format!("`{other}`"),
    }
}

fn shortened(text: &str) -> String {
    let clean: String = text.chars().take(60).map(|c| if c.is_control() { '?' } else { c }).collect();
    if text.chars().count() > 60 { format!("{clean}...") } else { clean }
}
