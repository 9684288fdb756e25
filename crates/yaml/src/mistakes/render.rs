//! Findings as text: file, line, the source line with carets, and the remedy.

use crate::mistakes::finding::Finding;
use crate::mistakes::findings::Findings;
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Level, Origin, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

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

/// Wraps text between words.
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
