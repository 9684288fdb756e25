//! YAML text -> a tree with positions.
//!
//! The parser's events are consumed without recursion, so depth is bounded here and not by the stack. What none of
//! our files has a use for and what would hide mistakes (anchors, aliases, merge keys, tags, several documents,
//! keys that are not plain) is refused with its position.

use crate::finding::FindingKind;
use crate::notes::Notes;
use crate::scalar;
use crate::source::Source;
use crate::tree::{Content, Entry, Node};
use saphyr_parser::{Event, Parser, ScalarStyle};
use serde_json::Value;
use std::collections::HashSet;
use std::ops::Range;

/// Deepest nesting that is read; a campaign needs six.
const DEPTH_LIMIT: usize = 32;

/// Maximum number of values that are read; the longest list of points a campaign's grid may have takes three each.
const VALUE_LIMIT: usize = 100_000;

/// A collection whose end has not been read yet.
struct Frame {
    start: usize,
    content: Content,
    /// A key that waits for its value.
    pending: Option<Pending>,
    seen: HashSet<String>,
}

struct Pending {
    key: String,
    span: Range<usize>,
    duplicate: bool,
}

/// Reads the text. `None` if no tree can be had; then at least one finding says why.
pub fn read(source: &Source, notes: &mut Notes) -> Option<Node> {
    Reader { source, notes, frames: Vec::new(), root: None, values: 0 }.read()
}

struct Reader<'a> {
    source: &'a Source,
    notes: &'a mut Notes,
    frames: Vec<Frame>,
    root: Option<Node>,
    values: usize,
}

/// Reading cannot go on; the finding is already noted.
struct Stop;

impl Reader<'_> {
    fn read(mut self) -> Option<Node> {
        let mut documents = 0;
        let parser = Parser::new_from_iter(self.source.text().chars());
        for event in parser {
            let (event, span) = match event {
                Ok(found) => found,
                Err(error) => {
                    let at = self.source.byte_of_char(error.marker().index());
                    let message = format!("this is not YAML: {}", error.info());
                    self.note(FindingKind::Syntax, at..at, message, SYNTAX_REMEDY);
                    return None;
                }
            };
            let span =
                self.source.byte_of_char(span.start.index())..self.source.byte_of_char(span.end.index());
            if matches!(event, Event::DocumentStart(_)) {
                documents += 1;
                if documents > 1 {
                    let remedy = "write one document per file, and remove the line `---`";
                    self.note(
                        FindingKind::Unsupported,
                        span,
                        "a second YAML document starts here".into(),
                        remedy,
                    );
                    return self.root;
                }
            }
            if self.on_event(event, span).is_err() {
                return None;
            }
        }
        if self.root.is_none() {
            let document = self.source.document;
            let remedy = format!("see `{}` for a complete {}", document.example, document.name);
            self.note(FindingKind::MissingKey, 0..0, "the file is empty".into(), &remedy);
        }
        self.root
    }

    fn note(&mut self, kind: FindingKind, span: Range<usize>, message: String, remedy: &str) {
        let source = self.source;
        self.notes.push_with(|| source.finding(kind, String::new(), span, message, remedy.to_owned()));
    }

    /// Bounds what later checks have to look at.
    fn count_value(&mut self, span: &Range<usize>) -> Result<(), Stop> {
        self.values += 1;
        if self.values <= VALUE_LIMIT {
            return Ok(());
        }
        self.note(
            FindingKind::TooLarge,
            span.clone(),
            format!("the file has more than {VALUE_LIMIT} values"),
            "is this the right file? A long list may have a shorter form, as a grid has `speeds` and `openings`",
        );
        Err(Stop)
    }

    fn on_event(&mut self, event: Event<'_>, span: Range<usize>) -> Result<(), Stop> {
        match event {
            Event::Scalar(text, style, anchor, tag) => {
                self.refuse_decoration(anchor != 0, tag.is_some(), &span);
                if self.waits_for_key() {
                    self.on_key(text.into_owned(), span);
                    return Ok(());
                }
                self.count_value(&span)?;
                let value = if style == ScalarStyle::Plain && tag.is_none() {
                    scalar::resolve(&text).unwrap_or_else(|| {
                        self.note(
                            FindingKind::WrongValue,
                            span.clone(),
                            format!("`{text}` is not a finite number"),
                            "write a number, or put the text into quotes",
                        );
                        Value::Null
                    })
                } else {
                    Value::String(text.into_owned())
                };
                self.on_value(Node { span, content: Content::Scalar(value) });
                Ok(())
            }
            Event::SequenceStart(anchor, tag) => {
                self.refuse_decoration(anchor != 0, tag.is_some(), &span);
                self.open(span, Content::Sequence(Vec::new()))
            }
            Event::MappingStart(anchor, tag) => {
                self.refuse_decoration(anchor != 0, tag.is_some(), &span);
                self.open(span, Content::Mapping(Vec::new()))
            }
            Event::SequenceEnd | Event::MappingEnd => {
                if let Some(frame) = self.frames.pop() {
                    let end = span.end.max(frame.start);
                    self.on_value(Node { span: frame.start..end, content: frame.content });
                }
                Ok(())
            }
            Event::Alias(_) => {
                self.count_value(&span)?;
                self.note(
                    FindingKind::Unsupported,
                    span.clone(),
                    format!("aliases (`*name`) are not read in a {}", self.source.document.name),
                    "write the value out",
                );
                if self.waits_for_key() {
                    self.on_key(String::new(), span);
                } else {
                    self.on_value(Node { span, content: Content::Scalar(Value::Null) });
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn waits_for_key(&self) -> bool {
        self.frames
            .last()
            .is_some_and(|frame| frame.pending.is_none() && matches!(frame.content, Content::Mapping(_)))
    }

    fn refuse_decoration(&mut self, anchored: bool, tagged: bool, span: &Range<usize>) {
        if anchored {
            self.note(
                FindingKind::Unsupported,
                span.clone(),
                format!("anchors (`&name`) are not read in a {}", self.source.document.name),
                "remove the anchor, and write the value out where it was used",
            );
        }
        if tagged {
            self.note(
                FindingKind::Unsupported,
                span.clone(),
                format!("tags (`!name`) are not read in a {}", self.source.document.name),
                "remove the tag",
            );
        }
    }

    fn open(&mut self, span: Range<usize>, content: Content) -> Result<(), Stop> {
        if self.waits_for_key() {
            self.note(
                FindingKind::Syntax,
                span,
                "a key must be plain text, but this is a list or a mapping".into(),
                SYNTAX_REMEDY,
            );
            return Err(Stop);
        }
        self.count_value(&span)?;
        if self.frames.len() >= DEPTH_LIMIT {
            self.note(
                FindingKind::TooLarge,
                span,
                format!("the nesting is deeper than {DEPTH_LIMIT} levels"),
                "six levels are enough; look for a bracket that is not closed",
            );
            return Err(Stop);
        }
        self.frames.push(Frame { start: span.start, content, pending: None, seen: HashSet::new() });
        Ok(())
    }

    fn on_key(&mut self, key: String, span: Range<usize>) {
        if key == "<<" {
            self.note(
                FindingKind::Unsupported,
                span.clone(),
                format!("merge keys (`<<`) are not read in a {}", self.source.document.name),
                "write the keys out",
            );
        }
        let Some(frame) = self.frames.last_mut() else { return };
        // A refused merge key is dropped with its value.
        let duplicate = !frame.seen.insert(key.clone());
        frame.pending =
            Some(Pending { duplicate: duplicate || key == "<<", key: key.clone(), span: span.clone() });
        if duplicate && key != "<<" {
            self.note(
                FindingKind::DuplicateKey,
                span,
                format!("the key `{key}` appears here a second time"),
                "remove one of the two",
            );
        }
    }

    fn on_value(&mut self, node: Node) {
        let Some(frame) = self.frames.last_mut() else {
            self.root.get_or_insert(node);
            return;
        };
        match &mut frame.content {
            Content::Sequence(items) => items.push(node),
            Content::Mapping(entries) => {
                if let Some(pending) = frame.pending.take().filter(|pending| !pending.duplicate) {
                    entries.push(Entry { key: pending.key, key_span: pending.span, value: node });
                }
            }
            Content::Scalar(_) => {}
        }
    }
}

const SYNTAX_REMEDY: &str =
    "check the indentation (spaces, no tabs), the space after each colon, quotes and brackets up to here";
