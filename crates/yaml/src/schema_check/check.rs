//! Turns every violation of the schema into a finding at its position.
//!
//! serde would stop at the first mistake, and would lose position and choices for untagged enums and unknown keys.

use crate::document::path::{Step, path_text};
use crate::document::tree::Tree;
use crate::mistakes::finding::{Finding, FindingKind};
use crate::mistakes::notes::Notes;
use crate::schema_check::complaint::{
    complain, example_of, example_sentence, keys_of, quoted, replacement, shortened, with_description,
    wrong_name,
};
use crate::schema_check::quantity_check::{self, Complaint};
use crate::schema_check::rules::{Rule, Violation, violations};
use crate::schema_check::schema::Schema;
use crate::schema_check::suggestion::{closest, guess};
use serde_json::{Map, Value};
use std::collections::HashSet;

/// Unknown keys of one mapping that are reported; looking up the place of each takes time.
const UNKNOWN_KEYS_LIMIT: usize = 200;

impl Schema {
    /// Checks everything the schema says, quantities included, and notes what is wrong.
    pub fn check(&self, tree: &Tree, notes: &mut Notes) {
        // A rejected value already has a finding.
        let refused = notes.list().iter().map(|finding| finding.span.start).collect();
        let mut check = Check { tree, notes, refused };
        for violation in violations(&self.value, tree.value()) {
            check.translate(&violation);
            if check.notes.is_full() {
                break;
            }
        }
    }
}

struct Check<'a> {
    tree: &'a Tree,
    notes: &'a mut Notes,
    refused: HashSet<usize>,
}

impl Check<'_> {
    fn translate(&mut self, violation: &Violation<'_>) {
        let Violation { steps, schema, value, rule } = violation;
        match rule {
            Rule::Quantity(complaint) => self.note(steps, complaint),
            // Type, range and kind all fail for one mistake.
            _ if quantity_check::check(schema, value).is_some() => {}
            Rule::UnknownKeys(keys) => self.unknown_keys(steps, keys, schema),
            Rule::MissingKey(key) => self.missing_key(steps, key, schema),
            Rule::NoForm(forms) => self.best_form(steps, forms, schema, value),
            rule => {
                if let Some(complaint) = complain(rule, schema, value) {
                    self.note(steps, &complaint);
                }
            }
        }
    }

    fn note(&mut self, steps: &[Step], Complaint { kind, message, remedy }: &Complaint) {
        self.push(self.tree.finding(*kind, steps, message, remedy));
    }

    fn push(&mut self, finding: Finding) {
        if !self.refused.contains(&finding.span.start) {
            self.notes.push(finding);
        }
    }

    fn unknown_keys(&mut self, steps: &[Step], unexpected: &[&str], schema: &Map<String, Value>) {
        let known = keys_of(schema);
        let within = match path_text(steps) {
            path if path.is_empty() => format!("in a {}", self.tree.source().document.name),
            path => format!("in `{path}`"),
        };
        for key in unexpected.iter().take(UNKNOWN_KEYS_LIMIT) {
            let (message, remedy) = match replacement(schema, key) {
                Some(remedy) => (format!("the key `{key}` is no longer known {within}"), remedy.to_owned()),
                None => (
                    format!("there is no key `{}` {within}", shortened(key)),
                    format!("{}the keys are {}", guess(key, &known), known.join(", ")),
                ),
            };
            let full = [steps, &[Step::from(*key)]].concat();
            self.push(self.tree.key_finding(FindingKind::UnknownKey, &full, message, remedy));
        }
    }

    fn missing_key(&mut self, steps: &[Step], key: &str, schema: &Map<String, Value>) {
        let known = keys_of(schema);
        let is_mistyped = |there: &str| !known.contains(&there) && closest(there, &known) == Some(key);
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
        let complaint = Complaint {
            kind: FindingKind::MissingKey,
            message: format!("{within} has no key `{key}`"),
            remedy: with_description(format!("write e.g. `{example}`"), property.and_then(Value::as_object)),
        };
        self.note(steps, &complaint);
    }

    /// For alternative forms, reports the violation of the form with the same type, which was probably intended.
    fn best_form(
        &mut self,
        steps: &[Step],
        forms: &[Vec<Violation<'_>>],
        schema: &Map<String, Value>,
        value: &Value,
    ) {
        let of_another_type = |violation: &Violation<'_>| {
            violation.steps.len() == steps.len() && matches!(violation.rule, Rule::Type)
        };
        let meant: Vec<_> = forms.iter().filter(|form| !form.iter().any(of_another_type)).collect();
        let names: Option<Vec<&str>> = meant
            .iter()
            .flat_map(|form| form.iter())
            .map(|violation| match &violation.rule {
                Rule::Names(names) => Some(names.as_slice()),
                _ => None,
            })
            .collect::<Option<Vec<_>>>()
            .map(|lists| lists.concat());
        match (names, meant.as_slice()) {
            // The description of the whole says more than that of the list of names.
            (Some(names), [_, ..]) => self.note(steps, &wrong_name(&names, schema, value)),
            (_, [form]) => form.iter().for_each(|violation| self.translate(violation)),
            _ => {
                let complaint = Complaint {
                    kind: FindingKind::WrongType,
                    message: format!("{} is not one of the forms allowed here", quoted(value)),
                    remedy: with_description(example_sentence(schema), Some(schema)),
                };
                self.note(steps, &complaint);
            }
        }
    }
}
