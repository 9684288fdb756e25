//! Findings for people: file, line, the source line with carets, and the remedy.

use crate::finding::{Finding, Findings};
use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError, MietteSpanContents,
    SourceCode, SourceSpan, SpanContents, ThemeCharacters, ThemeStyles,
};
use std::fmt;

/// Longest source line that is shown.
const LINE_LIMIT: usize = 400;

impl Findings {
    /// All findings, each with its place in the file; `colours` only where a terminal reads it.
    pub fn render(&self, colours: bool) -> String {
        // ASCII characters in both: the carets are carets, and logs stay legible.
        let styles = if colours { ThemeStyles::ansi() } else { ThemeStyles::none() };
        let handler = GraphicalReportHandler::new_themed(GraphicalTheme {
            characters: ThemeCharacters::ascii(),
            styles,
        })
        .with_context_lines(1)
        .with_links(false)
        .with_width(110)
        .without_syntax_highlighting();
        let name = self.source.origin.display().to_string();
        let mut out = String::new();
        for finding in &self.list {
            let line = Line::of(self.source.text(), &name, finding);
            let shown = line.text.len() <= LINE_LIMIT;
            if !shown {
                out.push_str(&format!("{name}:{}:{}\n", finding.line, finding.column));
            }
            let report = Report { finding, line: shown.then_some(line) };
            if handler.render_report(&mut out, &report).is_err() {
                out.push_str(&format!("{name}:{}:{}: {}\n", finding.line, finding.column, finding.message));
            }
            out.push('\n');
        }
        let count = self.count();
        let noun = if count == 1 { "mistake" } else { "mistakes" };
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

/// The source line of a finding.
#[derive(Debug)]
struct Line {
    name: String,
    /// Without its end, and without control characters: terminals obey them, and a file must not speak to them.
    text: String,
    /// Byte offset of the line in the file.
    start: usize,
    /// From 0.
    index: usize,
    /// Column of the finding, from 0.
    column: usize,
}

impl Line {
    fn of(text: &str, name: &str, finding: &Finding) -> Self {
        let at = finding.span.start;
        let start = text.get(..at).and_then(|before| before.rfind('\n')).map_or(0, |newline| newline + 1);
        let rest = text.get(start..).unwrap_or_default();
        let line = rest.split(['\n', '\r']).next().unwrap_or_default();
        // One replacement per character of the same length keeps the byte offsets.
        let harmless = |c: char| match c {
            c if !c.is_control() || c == '\t' => c,
            c if c.len_utf8() == 1 => '?',
            _ => '¿',
        };
        Line {
            name: name.to_owned(),
            text: line.chars().map(harmless).collect(),
            start,
            index: finding.line.saturating_sub(1),
            column: finding.column.saturating_sub(1),
        }
    }
}

impl SourceCode for Line {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        _after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        // Asked without context for the place in the heading, with context for the lines to show.
        let (at, column) =
            if before == 0 { (*span, self.column) } else { ((self.start, self.text.len()).into(), 0) };
        let contents =
            MietteSpanContents::new_named(self.name.clone(), self.text.as_bytes(), at, self.index, column, 1);
        Ok(Box::new(contents))
    }
}

#[derive(Debug)]
struct Report<'a> {
    finding: &'a Finding,
    line: Option<Line>,
}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.finding.path.is_empty() {
            f.write_str(&self.finding.message)
        } else {
            write!(f, "{}: {}", self.finding.path, self.finding.message)
        }
    }
}

impl std::error::Error for Report<'_> {}

impl Diagnostic for Report<'_> {
    fn help<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        Some(Box::new(&self.finding.remedy))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.line.as_ref().map(|line| line as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = &self.finding.span;
        Some(Box::new(std::iter::once(LabeledSpan::new(None, span.start, span.len().max(1)))))
    }
}
