//! The text of a file, the list of its mistakes (what, where and the remedy; the closest valid name), and each of them rendered with line and
//! caret.

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Level, Origin, Renderer, Snippet};
use serde::Serialize;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Kind of mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The text is not YAML, or not UTF-8.
    Syntax,
    /// YAML that is not supported: anchors, aliases, merge keys, tags, several documents.
    Unsupported,
    /// The file, its nesting or its grid is too large.
    TooLarge,
    /// A key that does not exist.
    UnknownKey,
    /// A key that occurs twice in one mapping.
    DuplicateKey,
    /// A required key is missing.
    MissingKey,
    /// Text where a number is needed, a list where a mapping is needed, and the like.
    WrongType,
    /// A value that is not allowed, or does not have the required form.
    WrongValue,
    /// A quantity without a unit, or with one of another kind of quantity.
    Unit,
    /// A value outside its range.
    Range,
    /// A point, speed or opening that occurs twice.
    Duplicate,
    /// Two statements that contradict each other.
    Conflict,
    /// A referenced file cannot be read.
    MissingFile,
    /// A point that the machine cannot reach within the limits.
    Unreachable,
    /// Values that are impossible for a machine, or that cannot give a result.
    Implausible,
    /// A warning: valid, but rarely intended.
    Unusual,
}

impl FindingKind {
    /// Whether the finding is a warning, and the file can be used.
    pub fn is_warning(self) -> bool {
        self == FindingKind::Unusual
    }
}

/// A mistake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Kind of mistake.
    pub kind: FindingKind,
    /// Path of keys, e.g. `grid.points[3].speed`; empty for the file as a whole.
    pub path: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// Description, with values and units.
    pub message: String,
    /// Remedy.
    pub remedy: String,
    /// Byte range in the text, within one line.
    #[serde(skip)]
    pub span: Range<usize>,
}

/// Maximum number of findings shown; further ones are counted.
const SHOWN_LIMIT: usize = 100;

/// The candidate closest to a mistyped word, with at most a third of its letters wrong; case is ignored.
pub fn closest<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // A very long word is not a typing error, and the cost of the distance grows with its square.
    if word.len() > 64 {
        return None;
    }
    let lower = word.to_lowercase().replace('-', "_");
    candidates
        .iter()
        .map(|candidate| (strsim::osa_distance(&lower, &candidate.to_lowercase()), *candidate))
        .filter(|(distance, candidate)| {
            let length = candidate.chars().count().max(lower.chars().count());
            // A word with no correct letter is a different word.
            *distance <= length.div_ceil(3) && *distance < length
        })
        .min()
        .map(|(_, candidate)| candidate)
}

/// `did you mean ...? `, or nothing.
pub(crate) fn guess(word: &str, candidates: &[&str]) -> String {
    closest(word, candidates).map(|guess| format!("did you mean `{guess}`? ")).unwrap_or_default()
}

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

/// All mistakes of a file, in the order of the text.
///
/// [`Display`](std::fmt::Display) renders them without colours; see [`Findings::render`].
#[derive(Debug, Clone)]
pub struct Findings {
    pub(crate) source: Box<Source>,
    /// At most [`Findings::LIMIT`] mistakes.
    pub list: Vec<Finding>,
    /// Number of further mistakes.
    pub omitted: usize,
}

impl Findings {
    /// Maximum number of findings that are kept; further ones are counted.
    pub const LIMIT: usize = SHOWN_LIMIT;

    /// The notes about a text, in the order of the text.
    pub fn new(source: Source, notes: Notes) -> Self {
        let Notes { mut list, overflow } = notes;
        list.sort_by_key(|finding| finding.span.start);
        let omitted = list.len().saturating_sub(Self::LIMIT) + overflow;
        list.truncate(Self::LIMIT);
        Findings { source: Box::new(source), list, omitted }
    }

    /// A single mistake, at a byte of the text.
    pub fn single(source: Source, kind: FindingKind, at: usize, message: String, remedy: String) -> Self {
        let mut notes = Notes::default();
        notes.push(source.finding(kind, String::new(), at..at, message, remedy));
        Findings::new(source, notes)
    }

    /// The file with the mistakes.
    pub fn origin(&self) -> &Path {
        &self.source.origin
    }

    /// Number of mistakes, the omitted ones included.
    pub fn count(&self) -> usize {
        self.list.len() + self.omitted
    }
}

impl std::error::Error for Findings {}

/// Findings during the checks. Their number is limited, so that a hostile file cannot exhaust the memory.
#[derive(Debug, Default)]
pub struct Notes {
    list: Vec<Finding>,
    overflow: usize,
}

impl Notes {
    /// Ten times the number shown, so that those shown are the first ones of the file after sorting.
    const LIMIT: usize = 10 * SHOWN_LIMIT;

    /// Adds a finding.
    pub fn push(&mut self, finding: Finding) {
        self.push_with(|| finding);
    }

    /// Creates and adds a finding if the limit is not reached: locating it in a long line takes time.
    pub fn push_with(&mut self, finding: impl FnOnce() -> Finding) {
        if self.list.len() < Self::LIMIT {
            self.list.push(finding());
        } else {
            self.overflow += 1;
        }
    }

    /// Whether the limit was exceeded; further checks are then unnecessary.
    pub fn is_full(&self) -> bool {
        self.overflow > 0
    }

    /// Whether there are no findings.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The findings, in the order of the checks.
    pub fn list(&self) -> &[Finding] {
        &self.list
    }
}

/// Maximum length of a source line that is shown, bytes.
const LINE_LIMIT: usize = 400;

/// Width to which messages are wrapped, characters: 80 with the margin of their level.
const WIDTH: usize = 68;
const MARGIN: usize = 12;

impl Findings {
    /// All findings, each with its place in the file; `colours` only for a terminal.
    pub fn render(&self, colours: bool) -> String {
        // ASCII characters, so that logs stay legible.
        let renderer = if colours { Renderer::styled() } else { Renderer::plain() }
            .decor_style(DecorStyle::Ascii)
            .term_width(WIDTH + MARGIN);
        let name = replace_control_characters(&self.source.origin.display().to_string());
        let mut out = String::new();
        for finding in &self.list {
            let message = match finding.path.as_str() {
                "" => finding.message.clone(),
                path => format!("{path}: {}", finding.message),
            };
            let level = if finding.kind.is_warning() { Level::WARNING } else { Level::ERROR };
            let title = level.primary_title(wrap(&message));
            let line = Line::of(self.source.text(), finding);
            let group = if line.text.len() <= LINE_LIMIT {
                let span = AnnotationKind::Primary.span(line.span.clone());
                let snippet =
                    Snippet::source(&line.text).path(&name).line_start(finding.line).annotation(span);
                title.element(snippet)
            } else {
                title.element(Origin::path(&name).line(finding.line).char_column(finding.column))
            };
            let help = Level::HELP.message(wrap(&finding.remedy));
            out.push_str(&renderer.render(&[group.element(help)]));
            out.push_str("\n\n");
        }
        let count = self.count();
        // Warnings and mistakes never occur together: only files without mistakes are checked for warnings.
        let warnings = self.list.first().is_some_and(|finding| finding.kind.is_warning());
        let noun = match (warnings, count) {
            (false, 1) => "mistake",
            (false, _) => "mistakes",
            (true, 1) => "warning",
            (true, _) => "warnings",
        };
        out.push_str(&format!("{name}: {count} {noun}"));
        if self.omitted > 0 {
            out.push_str(&format!(", the first {} shown", self.list.len()));
        }
        out.push('\n');
        out
    }
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

/// The source line of a finding, without its end.
struct Line {
    text: String,
    /// Byte range of the finding in it; a place without extent covers one character.
    span: Range<usize>,
}

impl Line {
    fn of(text: &str, finding: &Finding) -> Self {
        let at = finding.span.start;
        let start = text.get(..at).and_then(|before| before.rfind('\n')).map_or(0, |newline| newline + 1);
        let rest = text.get(start..).unwrap_or_default();
        let line = rest.split(['\n', '\r']).next().unwrap_or_default();
        let from = (at - start).min(line.len());
        let next = line.get(from..).and_then(|rest| rest.chars().next()).map_or(0, char::len_utf8);
        let to = (finding.span.end.max(at) - start).max(from + next).min(line.len());
        Line { text: replace_control_characters(line), span: from..to }
    }
}

/// Replaces control characters, which a terminal would interpret, by characters of the same length, so that byte offsets stay valid.
fn replace_control_characters(text: &str) -> String {
    let replace = |c: char| match c {
        c if !c.is_control() || c == '\t' => c,
        c if c.len_utf8() == 1 => '?',
        _ => '¿',
    };
    text.chars().map(replace).collect()
}

fn wrap(text: &str) -> String {
    let mut out = String::new();
    let mut width = 0;
    for word in replace_control_characters(text).split(' ') {
        let length = word.chars().count();
        if width > 0 && width + 1 + length > WIDTH {
            out.push('\n');
            width = 0;
        } else if width > 0 {
            out.push(' ');
            width += 1;
        }
        out.push_str(word);
        width += length;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_recognised_and_another_word_is_not() {
        let keys = ["inlet_pressure", "T_oil", "N"];
        for (word, meant) in [
            ("inlet_presure", Some("inlet_pressure")),
            ("Inlet-Pressure", Some("inlet_pressure")),
            ("t_oil", Some("T_oil")),
            ("speed", None),
            ("", None),
        ] {
            assert_eq!(closest(word, &keys), meant, "{word}");
        }
    }
}
