//! The values of a YAML text, and their places.

use crate::document::positions::{Place, Places, SYNTAX_REMEDY, Step, locate, path_text};
use crate::source::{Finding, FindingKind, Findings, Notes, Source};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::ops::Range;

/// A parsed YAML text.
#[derive(Debug)]
pub struct Tree {
    source: Source,
    /// The text for serde_yaml.
    readable: String,
    value: Value,
    places: Places,
}

/// Parses a text. The notes are about unsupported features of YAML.
///
/// # Errors
/// The mistakes that make the text unreadable.
pub fn read(source: Source) -> Result<(Tree, Notes), Findings> {
    let mut notes = Notes::default();
    let Some((places, readable)) = locate(&source, &mut notes) else {
        return Err(Findings::new(source, notes));
    };
    let document = serde_yaml::Deserializer::from_str(&readable).next();
    match document.map_or(Ok(Value::Null), Value::deserialize) {
        Ok(value) => Ok((Tree { source, readable, value, places }, notes)),
        Err(error) => {
            // A rejected YAML feature may be the cause; it has been noted already.
            if notes.is_empty() {
                let at = error.location().map_or(0, |location| source.byte_of_char(location.index()));
                let message = format!("this is not YAML: {error}");
                let remedy = SYNTAX_REMEDY.to_owned();
                notes.push(source.finding(FindingKind::Syntax, String::new(), at..at, message, remedy));
            }
            Err(Findings::new(source, notes))
        }
    }
}

impl Tree {
    /// The text.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// All values.
    pub fn value(&self) -> &Value {
        &self.value
    }

    /// The value at the end of a path.
    pub fn get(&self, steps: &[Step]) -> Option<&Value> {
        steps.iter().try_fold(&self.value, |value, step| match step {
            Step::Key(key) => value.get(key),
            Step::Index(index) => value.get(index),
        })
    }

    /// The text at the end of a path.
    pub fn text(&self, steps: &[Step]) -> Option<&str> {
        self.get(steps)?.as_str()
    }

    /// The items of a list at the end of a path; empty for everything else.
    pub fn items(&self, steps: &[Step]) -> &[Value] {
        self.get(steps).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    /// The keys of a mapping at the end of a path.
    pub fn keys(&self, steps: &[Step]) -> impl Iterator<Item = &str> {
        self.get(steps).and_then(Value::as_object).into_iter().flatten().map(|(key, _)| key.as_str())
    }

    /// Byte range for a finding about a value: the scalar itself, or the key of a mapping or list. If the path does not exist, that of the
    /// nearest parent.
    pub fn place(&self, steps: &[Step]) -> Range<usize> {
        self.places.nearest(steps).map_or(0..0, |(place, _)| place.value.clone())
    }

    /// A finding about a value.
    pub fn finding(
        &self,
        kind: FindingKind,
        steps: &[Step],
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Finding {
        let place = self.place(steps);
        self.source.finding(kind, path_text(steps), place, message.into(), remedy.into())
    }

    /// A finding about a key, if the key itself is wrong and not its value.
    pub fn key_finding(
        &self,
        kind: FindingKind,
        steps: &[Step],
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Finding {
        let place = match self.places.nearest(steps) {
            Some((Place { key: Some(key), .. }, true)) => key.clone(),
            _ => self.place(steps),
        };
        self.source.finding(kind, path_text(steps), place, message.into(), remedy.into())
    }

    /// Deserialises the text into a type. Call it only if no mistakes were found.
    ///
    /// # Errors
    /// The first value that the type rejects although its schema allows it.
    pub fn deserialise<T: DeserializeOwned>(&self) -> Result<T, Finding> {
        let document = serde_yaml::Deserializer::from_str(&self.readable);
        serde_path_to_error::deserialize(document).map_err(|error| {
            let steps = error.path().iter().filter_map(|segment| match segment {
                serde_path_to_error::Segment::Seq { index } => Some(Step::Index(*index)),
                serde_path_to_error::Segment::Map { key } => Some(Step::Key(key.clone())),
                _ => None,
            });
            let (kind, steps) = (FindingKind::WrongValue, steps.collect::<Vec<_>>());
            let remedy = "put the value into quotes, or write it in a simpler form";
            self.finding(kind, &steps, error.inner().to_string(), remedy)
        })
    }

    /// Replaces a secret value by asterisks of the same length, so that all positions stay valid.
    pub fn hide(&mut self, steps: &[Step]) {
        let (place, text) = (self.place(steps), self.source.text());
        let hidden = |(at, byte): (usize, u8)| if place.contains(&at) && byte != b'\n' { b'*' } else { byte };
        let text: Vec<u8> = text.bytes().enumerate().map(hidden).collect();
        self.source = Source::new(self.source.document, &self.source.origin, &String::from_utf8_lossy(&text));
    }

    /// All findings about the text.
    pub fn findings(self, notes: Notes) -> Findings {
        Findings::new(self.source, notes)
    }
}

/// Kinds of files: the key that only they have, what they are, and the command that reads them.
const KINDS: [(&str, &str, &str); 4] = [
    ("campaign", "a campaign", "use `mapper check FILE` or `mapper run FILE`"),
    ("nightly", "a list of nightly runs", "use `mapper nightly FILE`"),
    ("fleet", "a study of a fleet", "use `mapper fleet make FILE --out DIR`"),
    ("channels", "a channel map", "use it as `mapper identify RECORDING --channels FILE`"),
];

impl Tree {
    /// Finding about a file that is not of its kind: it has the key of another kind instead of its `own`, or none of the `known` keys.
    pub fn find_other_kind(&self, own: &str, known: &[&str]) -> Option<Finding> {
        let has = |key: &str| self.value().get(key).is_some();
        let keys = self.value().as_object().map_or(0, |keys| keys.len());
        // A study has the key `campaign` too, but few others of a campaign.
        if has(own) && 2 * known.iter().filter(|key| has(key)).count() >= keys {
            return None;
        }
        let name = self.source().document.name;
        let is_other = |key: &str| has(key) && !known.contains(&key) && !(key == "campaign" && has(own));
        if let Some((key, kind, remedy)) = KINDS.iter().find(|(key, ..)| is_other(key)) {
            let message = format!("this is {kind}, not a {name}");
            return Some(self.finding(FindingKind::WrongValue, &[Step::from(*key)], message, *remedy));
        }
        let is_foreign = match self.value() {
            Value::Null => false,
            Value::Object(keys) => !keys.is_empty() && !keys.keys().any(|key| known.contains(&key.as_str())),
            _ => true,
        };
        is_foreign.then(|| {
            let remedy = format!(
                "`{}` is one; `mapper map inspect` shows maps, `mapper log inspect` logs",
                self.source().document.example
            );
            self.finding(
                FindingKind::WrongType,
                &[],
                format!("this is not a {name}: no key of one is in it"),
                remedy,
            )
        })
    }
}
