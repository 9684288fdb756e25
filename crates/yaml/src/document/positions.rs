//! A YAML text: its values, their positions, and the path of a value.

use crate::source::{Finding, FindingKind, Findings, Notes, Source};
use saphyr_parser::{Event, Marker, Parser, ScalarStyle, ScanError};
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;
use std::collections::HashMap;
use std::ops::Range;

/// Maximum depth of nesting; a campaign needs six.
const DEPTH_LIMIT: usize = 32;

/// Maximum number of values; the longest grid of a campaign needs three for each point.
const VALUE_LIMIT: usize = 100_000;

/// Maximum length of the text after a syntax error that libyaml parses to locate the error: its run time grows with the square of the
/// nesting.
const TAIL_LIMIT: usize = 1000;

pub(crate) const SYNTAX_REMEDY: &str =
    "check the indentation (spaces, no tabs), the space after each colon, quotes and brackets up to here";

/// Position of a value and its key.
#[derive(Debug)]
pub(crate) struct Place {
    /// Byte range of the key; `None` for an item of a list.
    pub key: Option<Range<usize>>,
    /// Byte range that a finding about the value marks: the scalar itself, or the key of a mapping or list.
    pub value: Range<usize>,
}

/// The places of all values, the root first.
#[derive(Debug, Default)]
pub(crate) struct Places {
    list: Vec<Place>,
    /// Index of a child by the index of its parent.
    children: HashMap<(usize, Step), usize>,
}

impl Places {
    /// The place at the end of a path and true, or the place of its nearest existing parent and false.
    pub fn nearest(&self, steps: &[Step]) -> Option<(&Place, bool)> {
        let mut index = 0;
        let mut descend = |step: &Step| {
            index = *self.children.get(&(index, step.clone()))?;
            Some(())
        };
        let is_end = steps.iter().all(|step| descend(step).is_some());
        Some((self.list.get(index)?, is_end))
    }
}

/// Returns the places, and the text for serde_yaml: without the rejected aliases and tags, and with a blank in `{key:}`,
/// which is valid YAML 1.2 and an error for libyaml. `None` if the text cannot be parsed; at least one note gives
/// the reason.
pub(crate) fn locate(source: &Source, notes: &mut Notes) -> Option<(Places, String)> {
    let readable = source.text().to_owned();
    let mut walk =
        Walk { source, notes, places: Places::default(), open: Vec::new(), readable, empty: Vec::new() };
    walk.document().ok()?;
    let Walk { places, mut readable, empty, .. } = walk;
    for colon in empty.into_iter().rev() {
        if source.text().get(colon..).is_some_and(|rest| rest.starts_with(':')) {
            readable.insert(colon + 1, ' ');
        }
    }
    Some((places, readable))
}

/// A collection whose end has not been reached.
struct Open {
    /// Index of its place.
    index: usize,
    parts: Parts,
}

enum Parts {
    /// Index of the next item.
    List(usize),
    /// A key whose value follows, and its place.
    Mapping(Option<(String, Range<usize>)>),
}

struct Walk<'a> {
    source: &'a Source,
    notes: &'a mut Notes,
    places: Places,
    open: Vec<Open>,
    readable: String,
    /// Offsets of the colons whose value is not written.
    empty: Vec<usize>,
}

/// The parser cannot continue; the finding is already noted.
struct Stop;

impl Walk<'_> {
    fn document(&mut self) -> Result<(), Stop> {
        let text = self.source.text();
        // These are line breaks in YAML 1.1 only: libyaml starts a new line, saphyr continues a comment.
        if let Some((at, breaks)) = text.char_indices().find(|(_, c)| "\u{85}\u{2028}\u{2029}".contains(*c)) {
            let message = format!("the character U+{:04X} is not allowed", u32::from(breaks));
            self.note(FindingKind::Unsupported, at..at, message, "remove it");
            return Err(Stop);
        }
        let mut documents = 0;
        for event in Parser::new_from_iter(with_plain_blanks(text)) {
            let (event, span) = event.map_err(|error| self.on_syntax_error(&error))?;
            let byte = |marker: Marker| self.source.byte_of_char(marker.index());
            let span = byte(span.start)..byte(span.end);
            if matches!(event, Event::DocumentStart(_)) {
                documents += 1;
                if documents > 1 {
                    let message = "a second YAML document starts here".to_owned();
                    let remedy = "write one document per file, and remove the line `---`";
                    self.note(FindingKind::Unsupported, span, message, remedy);
                    return Ok(());
                }
            }
            self.on_event(event, span)?;
        }
        if self.places.list.is_empty() {
            let document = self.source.document;
            let remedy = format!("see `{}` for a complete {}", document.example, document.name);
            self.note(FindingKind::MissingKey, 0..0, "the file is empty".into(), &remedy);
            return Err(Stop);
        }
        Ok(())
    }

    fn note(&mut self, kind: FindingKind, span: Range<usize>, message: String, remedy: &str) {
        let source = self.source;
        self.notes.push_with(|| source.finding(kind, String::new(), span, message, remedy.to_owned()));
    }

    /// Notes a syntax error at the position given by libyaml: for a tab, saphyr gives the line before it.
    fn on_syntax_error(&mut self, error: &ScanError) -> Stop {
        let text = self.source.text();
        let at = self.source.byte_of_char(error.marker().index());
        let lines = text.get(at..).into_iter().flat_map(|tail| tail.split_inclusive('\n')).take(2);
        let end = text.floor_char_boundary(at + lines.map(str::len).sum::<usize>().min(TAIL_LIMIT));
        let libyaml_result = serde_yaml::from_str::<IgnoredAny>(text.get(..end).unwrap_or_default());
        let located = libyaml_result.err().and_then(|error| {
            let place = self.source.byte_of_char(error.location()?.index());
            // At the end of the excerpt, the error is caused by the cut.
            (place < end).then(|| (place, error.to_string()))
        });
        let (at, reason) = located.unwrap_or_else(|| (at, error.info().to_owned()));
        let document = self.source.document;
        let is_yaml = self
            .source
            .origin
            .extension()
            .is_none_or(|ending| ["yaml", "yml", "json"].iter().any(|of| ending == *of));
        let remedy = match is_yaml {
            true => SYNTAX_REMEDY.to_owned(),
            false => format!("a {} is a YAML file, e.g. `{}`", document.name, document.example),
        };
        self.note(FindingKind::Syntax, at..at, format!("this is not YAML: {reason}"), &remedy);
        Stop
    }

    fn on_event(&mut self, event: Event<'_>, span: Range<usize>) -> Result<(), Stop> {
        match event {
            Event::Scalar(text, style, anchor, tag) => {
                self.refuse_decoration(anchor, tag.is_some(), &span);
                if self.waits_for_key() {
                    self.on_key(text.into_owned(), span);
                    return Ok(());
                }
                if style == ScalarStyle::Plain && tag.is_none() && !is_finite(&text) {
                    let message = format!("`{text}` is not a finite number");
                    let remedy = "write a number, or put the text into quotes";
                    self.note(FindingKind::WrongValue, span.clone(), message, remedy);
                }
                self.on_scalar(span)?;
            }
            Event::SequenceStart(anchor, tag) => {
                self.refuse_decoration(anchor, tag.is_some(), &span);
                self.on_start(span, Parts::List(0))?;
            }
            Event::MappingStart(anchor, tag) => {
                self.refuse_decoration(anchor, tag.is_some(), &span);
                self.on_start(span, Parts::Mapping(None))?;
            }
            Event::SequenceEnd | Event::MappingEnd => {
                let place = self.open.pop().and_then(|open| self.places.list.get_mut(open.index));
                // An item of a list is marked as a whole.
                if let Some(place) = place.filter(|place| place.key.is_none() && !self.open.is_empty()) {
                    place.value.end = span.end.max(place.value.start);
                }
            }
            Event::Alias(_) => {
                self.refuse("aliases (`*name`)", "write the value out", &span);
                self.blank(span.start);
                if self.waits_for_key() {
                    self.on_key(String::new(), span);
                } else {
                    self.on_scalar(span)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn waits_for_key(&self) -> bool {
        matches!(self.open.last(), Some(Open { parts: Parts::Mapping(None), .. }))
    }

    fn refuse(&mut self, syntax: &str, remedy: &str, span: &Range<usize>) {
        let message = format!("{syntax} are not allowed in a {}", self.source.document.name);
        self.note(FindingKind::Unsupported, span.clone(), message, remedy);
    }

    /// `anchor`: 0 if there is none.
    fn refuse_decoration(&mut self, anchor: usize, is_tagged: bool, span: &Range<usize>) {
        if anchor != 0 {
            let remedy = "remove the anchor, and write the value out where it was used";
            self.refuse("anchors (`&name`)", remedy, span);
        }
        if is_tagged {
            self.refuse("tags (`!name`)", "remove the tag", span);
            self.blank(span.start);
        }
    }

    /// Replaces an alias or a tag by blanks, so that the rest of the text is checked too.
    fn blank(&mut self, start: usize) {
        let token = self.readable.get(start..).filter(|rest| rest.starts_with(['*', '!']));
        let length = token.map_or(0, |token| {
            token.find(|c: char| c.is_whitespace() || ",[]{}".contains(c)).unwrap_or(token.len())
        });
        self.readable.replace_range(start..start + length, &" ".repeat(length));
    }

    fn on_key(&mut self, key: String, span: Range<usize>) {
        let Some(Open { index, parts: Parts::Mapping(pending) }) = self.open.last_mut() else { return };
        let is_known = self.places.children.contains_key(&(*index, Step::Key(key.clone())));
        *pending = Some((key.clone(), span.clone()));
        if key == "<<" {
            self.refuse("merge keys (`<<`)", "write the keys out", &span);
        } else if is_known {
            let message = format!("the key `{key}` appears here a second time");
            self.note(FindingKind::DuplicateKey, span, message, "remove one of the two");
        }
    }

    fn on_start(&mut self, span: Range<usize>, parts: Parts) -> Result<(), Stop> {
        if self.waits_for_key() {
            let message = "a key must be plain text, but this is a list or a mapping".to_owned();
            self.note(FindingKind::Syntax, span, message, SYNTAX_REMEDY);
            return Err(Stop);
        }
        if self.open.len() >= DEPTH_LIMIT {
            let message = format!("the nesting is deeper than {DEPTH_LIMIT} levels");
            let remedy = "six levels are enough; look for a bracket that is not closed";
            self.note(FindingKind::TooLarge, span, message, remedy);
            return Err(Stop);
        }
        let index = self.on_value(span, true)?;
        self.open.push(Open { index, parts });
        Ok(())
    }

    fn on_scalar(&mut self, span: Range<usize>) -> Result<(), Stop> {
        if span.is_empty() {
            self.empty.push(span.start);
        }
        self.on_value(span, false).map(drop)
    }

    /// Notes a value, and returns the index of its place.
    fn on_value(&mut self, span: Range<usize>, is_collection: bool) -> Result<usize, Stop> {
        let index = self.places.list.len();
        if index >= VALUE_LIMIT {
            let message = format!("the file has more than {VALUE_LIMIT} values");
            let remedy = "check that this is the right file; a grid is shorter with `speeds` and `openings`";
            self.note(FindingKind::TooLarge, span, message, remedy);
            return Err(Stop);
        }
        let start = span.start;
        let (parent, step, place) = match self.open.last_mut() {
            None => {
                self.places.list.push(Place { key: None, value: start..start });
                return Ok(index);
            }
            Some(Open { index, parts: Parts::List(next) }) => {
                *next += 1;
                (*index, Step::Index(*next - 1), Place { key: None, value: span })
            }
            Some(Open { index, parts: Parts::Mapping(pending) }) => {
                let (key, place) = pending.take().unwrap_or((String::new(), start..start));
                let value = if is_collection || span.is_empty() { place.clone() } else { span };
                (*index, Step::Key(key), Place { key: Some(place), value })
            }
        };
        self.places.list.push(place);
        // The last of two equal keys applies, as in serde_yaml.
        self.places.children.insert((parent, step), index);
        Ok(index)
    }
}

/// Replaces tabs by spaces, except in the indentation: saphyr rejects a tab after a colon, which is valid YAML.
fn with_plain_blanks(text: &str) -> impl Iterator<Item = char> {
    text.chars().scan(true, |is_indentation, c| {
        *is_indentation = c == '\n' || (*is_indentation && matches!(c, ' ' | '\t'));
        Some(if c == '\t' && !*is_indentation { ' ' } else { c })
    })
}

/// False for a plain scalar that is infinite or NaN as a number.
fn is_finite(text: &str) -> bool {
    let digits = text.trim_start_matches(['+', '-']);
    let is_named = [".inf", ".nan"].iter().any(|name| digits.eq_ignore_ascii_case(name));
    let is_number = digits.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    !(is_named || is_number && digits.parse().is_ok_and(f64::is_infinite))
}

/// A step from a value to one of its children.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Step {
    /// To the value of a key.
    Key(String),
    /// To an item of a list, from 0.
    Index(usize),
}

impl From<&str> for Step {
    fn from(key: &str) -> Step {
        Step::Key(key.to_owned())
    }
}

impl From<usize> for Step {
    fn from(index: usize) -> Step {
        Step::Index(index)
    }
}

/// `grid.points[3].speed`
pub fn path_text(steps: &[Step]) -> String {
    let mut text = String::new();
    for step in steps {
        match step {
            Step::Index(index) => text.push_str(&format!("[{index}]")),
            Step::Key(key) if text.is_empty() => text.push_str(key),
            Step::Key(key) => text.push_str(&format!(".{key}")),
        }
    }
    text
}

/// The steps to a place, from strings and indices: `steps!["grid", "points", 3]`.
#[macro_export]
macro_rules! steps {
    ($($step:expr),* $(,)?) => { [$($crate::Step::from($step)),*] };
}

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
