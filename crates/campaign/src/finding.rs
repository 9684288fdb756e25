//! What is wrong with a campaign file, where, and what would be right.

use serde::Serialize;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What kind of mistake it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The text is not YAML, or not UTF-8.
    Syntax,
    /// YAML that a campaign does not use: anchors, aliases, merge keys, tags, several documents.
    Unsupported,
    /// The file, its nesting or its grid is larger than anything sensible.
    TooLarge,
    /// A key that does not exist.
    UnknownKey,
    /// A key that stands twice in one mapping.
    DuplicateKey,
    /// A key that is needed and not there.
    MissingKey,
    /// Text where a number is needed, a list where a mapping is needed, and the like.
    WrongType,
    /// A value that is none of those allowed, or not of the form it needs.
    WrongValue,
    /// A quantity without its unit, or with one that does not measure it.
    Unit,
    /// A value outside its range.
    Range,
    /// A point, speed or opening that stands twice.
    Duplicate,
    /// Two statements that contradict each other.
    Conflict,
    /// A file that is named and cannot be read.
    MissingFile,
    /// A point that the machine cannot reach within the limits.
    Unreachable,
}

/// One mistake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What kind of mistake it is.
    pub kind: FindingKind,
    /// Path of keys, e.g. `grid.points[3].speed`; empty for the file as a whole.
    pub path: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// What is wrong, with values and units.
    pub message: String,
    /// What would be right.
    pub remedy: String,
    /// Byte range in the text, within one line.
    #[serde(skip)]
    pub span: Range<usize>,
}

/// All mistakes of a file, in the order of the text.
///
/// [`Display`](std::fmt::Display) renders them without colours; see [`Findings::render`].
#[derive(Debug, Clone)]
pub struct Findings {
    pub(crate) source: Box<Source>,
    /// At most [`Findings::LIMIT`] mistakes.
    pub list: Vec<Finding>,
    /// How many more there are.
    pub omitted: usize,
}

impl Findings {
    /// How many findings are kept; beyond that they are counted.
    pub const LIMIT: usize = 100;

    pub(crate) fn new(source: Source, notes: Notes) -> Self {
        let Notes { mut list, overflow } = notes;
        list.sort_by_key(|finding| finding.span.start);
        let omitted = list.len().saturating_sub(Self::LIMIT) + overflow;
        list.truncate(Self::LIMIT);
        Findings { source: Box::new(source), list, omitted }
    }

    /// The file they are about.
    pub fn origin(&self) -> &Path {
        &self.source.origin
    }

    /// Number of mistakes, those not kept included.
    pub fn count(&self) -> usize {
        self.list.len() + self.omitted
    }
}

impl std::error::Error for Findings {}

/// Findings as they are collected; a hostile file must not fill the memory with them.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    pub list: Vec<Finding>,
    overflow: usize,
}

impl Notes {
    /// Ten times what is shown, so that sorting by position shows the first ones of the file.
    const LIMIT: usize = 10 * Findings::LIMIT;

    pub fn push(&mut self, finding: Finding) {
        self.push_with(|| finding);
    }

    /// Makes the finding only if it is kept: placing it in a long line takes time.
    pub fn push_with(&mut self, finding: impl FnOnce() -> Finding) {
        if self.list.len() < Self::LIMIT {
            self.list.push(finding());
        } else {
            self.overflow += 1;
        }
    }

    /// Whether there were more than are worth keeping; then further checks are not worth their time either.
    pub fn is_full(&self) -> bool {
        self.overflow > 0
    }

    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}

/// A campaign's text, and how offsets become lines and columns.
#[derive(Debug, Clone)]
pub(crate) struct Source {
    pub origin: PathBuf,
    text: String,
    /// Byte offset of each character, the end included; empty for plain ASCII, where the two are equal.
    char_offsets: Vec<usize>,
    /// Byte offset of each line's first character.
    line_starts: Vec<usize>,
}

impl Source {
    pub fn new(origin: &Path, text: &str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_owned();
        let char_offsets = if text.is_ascii() {
            Vec::new()
        } else {
            text.char_indices().map(|(at, _)| at).chain([text.len()]).collect()
        };
        let newlines = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let line_starts = std::iter::once(0).chain(newlines.map(|(at, _)| at + 1)).collect();
        Source { origin: origin.to_owned(), text, char_offsets, line_starts }
    }

    pub fn text(&self) -> &str {
        &self.text
    }

    pub fn byte_of_char(&self, index: usize) -> usize {
        if self.char_offsets.is_empty() {
            return index.min(self.text.len());
        }
        self.char_offsets.get(index).copied().unwrap_or(self.text.len())
    }

    /// A finding about a byte range, cut to its first line.
    pub fn finding(
        &self,
        kind: FindingKind,
        path: String,
        span: Range<usize>,
        message: String,
        remedy: String,
    ) -> Finding {
        let bytes = self.text.as_bytes();
        let start = floor_char_boundary(&self.text, span.start);
        let line = self.line_starts.partition_point(|line_start| *line_start <= start);
        let line_start = self.line_starts.get(line.saturating_sub(1)).copied().unwrap_or_default();
        let column = 1 + self.text.get(line_start..start).map_or(0, |before| before.chars().count());
        let end = floor_char_boundary(&self.text, span.end).max(start);
        let cut = bytes
            .get(start..end)
            .and_then(|inside| inside.iter().position(|b| matches!(b, b'\n' | b'\r')))
            .map_or(end, |length| start + length);
        // The parser counts trailing blanks and comments into some spans.
        let trimmed = self.text.get(start..cut).map_or(0, |inside| inside.trim_end().len());
        Finding { kind, path, line, column, message, remedy, span: start..start + trimmed }
    }
}

fn floor_char_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}
