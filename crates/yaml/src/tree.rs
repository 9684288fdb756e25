//! A tree in which every key and value knows its place in the text.

use serde::de::DeserializeOwned;
use serde_json::Value;
use std::ops::Range;

/// A value and its place.
#[derive(Debug, Clone)]
pub struct Node {
    /// Byte range in the text.
    pub span: Range<usize>,
    /// The value.
    pub content: Content,
}

/// What a value is.
#[derive(Debug, Clone)]
pub enum Content {
    /// Null, boolean, number or text.
    Scalar(Value),
    /// A list.
    Sequence(Vec<Node>),
    /// Keys with their values, in the order of the text; no key occurs twice.
    Mapping(Vec<Entry>),
}

/// One key with its value.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The key.
    pub key: String,
    /// Byte range of the key in the text.
    pub key_span: Range<usize>,
    /// The value.
    pub value: Node,
}

/// One step from a node to a child.
#[derive(Debug, Clone, PartialEq)]
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

/// The steps to a place in a tree, from strings and indices: `steps!["grid", "points", 3]`.
#[macro_export]
macro_rules! steps {
    ($($step:expr),* $(,)?) => { [$($crate::Step::from($step)),*] };
}

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

    /// The place for a complaint about the thing at a path as a whole: at a scalar itself; at the key of a
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

    /// The place of the key at the end of a path, for complaints about the key itself.
    pub fn key_place(&self, parent: &[Step], key: &str) -> Range<usize> {
        let entry = self.get(parent).and_then(|node| node.entries().iter().find(|entry| entry.key == key));
        entry.map_or_else(|| self.place(parent), |entry| entry.key_span.clone())
    }

    /// The text of a scalar that is text.
    pub fn text(&self) -> Option<&str> {
        match &self.content {
            Content::Scalar(Value::String(text)) => Some(text),
            _ => None,
        }
    }

    /// The number of a scalar that is a plain number.
    pub fn number(&self) -> Option<f64> {
        match &self.content {
            Content::Scalar(Value::Number(number)) => number.as_f64(),
            _ => None,
        }
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

    /// The tree as a value of a type. A tree that was found right against the schema of the type fails here only
    /// if the schema is laxer than the type.
    ///
    /// # Errors
    /// [`ReadError`] with the place of the first value that does not fit.
    pub fn deserialise<T: DeserializeOwned>(&self) -> Result<T, ReadError> {
        serde_path_to_error::deserialize(self.to_json()).map_err(|error| {
            let steps = error.path().iter().filter_map(|segment| match segment {
                serde_path_to_error::Segment::Seq { index } => Some(Step::Index(*index)),
                serde_path_to_error::Segment::Map { key } => Some(Step::Key(key.clone())),
                _ => None,
            });
            ReadError { steps: steps.collect(), source: error.into_inner() }
        })
    }
}

/// Why a tree is not a value of a type.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path_text(.steps))]
pub struct ReadError {
    /// The place.
    pub steps: Vec<Step>,
    /// Why.
    pub source: serde_json::Error,
}
