//! YAML text -> a tree in which every key and value knows where it stands.
//!
//! The parser's events are consumed without recursion, so depth is bounded here and not by the stack. What a
//! campaign has no use for and what would hide mistakes (anchors, aliases, merge keys, tags, several documents,
//! keys that are not plain) is refused with its position.

use crate::finding::{FindingKind, Notes, Source};
use crate::scalar;
use saphyr_parser::{Event, Parser, ScalarStyle};
use serde_json::Value;
use std::collections::HashSet;
use std::ops::Range;

/// Deepest nesting that is read; a campaign needs six.
const DEPTH_LIMIT: usize = 32;

/// Most values that are read; the longest list of points a grid may have takes three each.
const VALUE_LIMIT: usize = 100_000;

/// A value and where it stands.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Byte range in the text.
    pub span: Range<usize>,
    pub content: Content,
}

#[derive(Debug, Clone)]
pub(crate) enum Content {
    /// Null, boolean, number or text.
    Scalar(Value),
    Sequence(Vec<Node>),
    Mapping(Vec<Entry>),
}

#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub key: String,
    pub key_span: Range<usize>,
    pub value: Node,
}

/// One step from a node to a child.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Step {
    Key(String),
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
pub(crate) fn path_text(steps: &[Step]) -> String {
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

/// The steps to a place in a tree, from strings and indices.
macro_rules! steps {
    ($($step:expr),* $(,)?) => { [$($crate::tree::Step::from($step)),*] };
}
pub(crate) use steps;

impl Node {
    fn child(&self, step: &Step) -> Option<(Option<&Range<usize>>, &Node)> {
        match (step, &self.content) {
            (Step::Key(key), Content::Mapping(entries)) => entries
                .iter()
                .find(|entry| entry.key == *key)
                .map(|entry| (Some(&entry.key_span), &entry.value)),
            (Step::Index(index), Content::Sequence(items)) => items.get(*index).map(|item| (None, item)),
            _ => None,
        }
    }

    /// The node at the end of a path.
    pub fn get(&self, steps: &[Step]) -> Option<&Node> {
        steps.iter().try_fold(self, |node, step| node.child(step).map(|(_, child)| child))
    }

    /// The items of a sequence; empty for everything else.
    pub fn items(&self) -> &[Node] {
        match &self.content {
            Content::Sequence(items) => items,
            _ => &[],
        }
    }

    /// The entries of a mapping; empty for everything else.
    pub fn entries(&self) -> &[Entry] {
        match &self.content {
            Content::Mapping(entries) => entries,
            _ => &[],
        }
    }

    /// Where to point for a complaint about the thing at a path as a whole: at a scalar itself; at the key of a
    /// mapping or sequence; at the deepest parent there is, if the path leads nowhere.
    pub fn place(&self, steps: &[Step]) -> Range<usize> {
        let mut node = self;
        let mut place = self.span.start..self.span.start;
        for step in steps {
            let Some((key_span, child)) = node.child(step) else { break };
            node = child;
            place = match (&child.content, key_span) {
                (Content::Sequence(_) | Content::Mapping(_), Some(key)) => key.clone(),
                (Content::Scalar(Value::Null), Some(key)) if child.span.is_empty() => key.clone(),
                _ => child.span.clone(),
            };
        }
        place
    }

    /// Where the key at the end of a path stands, for complaints about the key itself.
    pub fn key_place(&self, parent: &[Step], key: &str) -> Range<usize> {
        let entry = self.get(parent).and_then(|node| node.entries().iter().find(|entry| entry.key == key));
        entry.map_or_else(|| self.place(parent), |entry| entry.key_span.clone())
    }

    /// The tree without its positions.
    pub fn to_json(&self) -> Value {
        match &self.content {
            Content::Scalar(value) => value.clone(),
            Content::Sequence(items) => Value::Array(items.iter().map(Node::to_json).collect()),
            Content::Mapping(entries) => Value::Object(
                entries.iter().map(|entry| (entry.key.clone(), entry.value.to_json())).collect(),
            ),
        }
    }
}

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

/// Reads the text. `None` where no tree can be had; then at least one finding says why.
pub(crate) fn read(source: &Source, notes: &mut Notes) -> Option<Node> {
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
                    let remedy = "write one campaign per file, and remove the line `---`";
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
            self.note(
                FindingKind::MissingKey,
                0..0,
                "the file is empty".into(),
                "see `campaigns/turbo_a.yaml` for a complete campaign",
            );
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
            "write a regular grid as `speeds` and `openings`",
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
                    "aliases (`*name`) are not read in a campaign".into(),
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
                "anchors (`&name`) are not read in a campaign".into(),
                "remove the anchor, and write the value out where it was used",
            );
        }
        if tagged {
            self.note(
                FindingKind::Unsupported,
                span.clone(),
                "tags (`!name`) are not read in a campaign".into(),
                "remove the tag",
            );
        }
    }

    fn open(&mut self, span: Range<usize>, content: Content) -> Result<(), Stop> {
        if self.waits_for_key() {
            self.note(
                FindingKind::Syntax,
                span,
                "a key must be plain text, but a list or mapping stands here".into(),
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
                "a campaign needs six levels; look for a bracket that is not closed",
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
                "merge keys (`<<`) are not read in a campaign".into(),
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
                format!("the key `{key}` stands here a second time"),
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
    "check indentation (blanks, no tabs), the blank after each colon, quotes and brackets up to here";
