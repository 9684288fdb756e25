//! A text with its origin, and the conversion of offsets to lines and columns.

use crate::mistakes::finding::{Finding, FindingKind};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Name of a kind of file in messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Document {
    /// Name, which takes the article `a`, e.g. `campaign`.
    pub name: &'static str,
    /// A complete example that ships with the program, e.g. `campaigns/turbo_a.yaml`.
    pub example: &'static str,
}

/// A text with its origin.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file, for messages; relative paths in the text start from its directory.
    pub origin: PathBuf,
    /// Kind of file.
    pub document: &'static Document,
    text: String,
    /// Byte offset of each character, the end included; empty for ASCII, because there both offsets are equal.
    char_offsets: Vec<usize>,
    /// Byte offset of each line's first character.
    line_starts: Vec<usize>,
}

impl Source {
    /// A text, without the byte order mark that some editors put before it.
    pub fn new(document: &'static Document, origin: &Path, text: &str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_owned();
        let char_offsets = if text.is_ascii() {
            Vec::new()
        } else {
            text.char_indices().map(|(at, _)| at).chain([text.len()]).collect()
        };
        let newlines = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let line_starts = std::iter::once(0).chain(newlines.map(|(at, _)| at + 1)).collect();
        Source { origin: origin.to_owned(), document, text, char_offsets, line_starts }
    }

    /// The text; spans are byte ranges of it.
    pub fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn byte_of_char(&self, index: usize) -> usize {
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
        let start = self.text.floor_char_boundary(span.start);
        let line = self.line_starts.partition_point(|line_start| *line_start <= start);
        let line_start = self.line_starts.get(line.saturating_sub(1)).copied().unwrap_or_default();
        let column = 1 + self.text.get(line_start..start).map_or(0, |before| before.chars().count());
        let end = self.text.floor_char_boundary(span.end).max(start);
        let cut = bytes
            .get(start..end)
            .and_then(|inside| inside.iter().position(|b| matches!(b, b'\n' | b'\r')))
            .map_or(end, |length| start + length);
        // The parser includes trailing blanks and comments in some spans.
        let trimmed = self.text.get(start..cut).map_or(0, |inside| inside.trim_end().len());
        Finding { kind, path, line, column, message, remedy, span: start..start + trimmed }
    }
}
