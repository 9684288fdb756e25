//! Documents for a terminal of 80 columns.

use super::model::{Block, Document, Facts, Look, Section, Table, Tone, verdict_word};
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table as Layout, Width, presets};
use mapper_core::{Verdict, coloured_text};
use std::fmt;

/// Columns of a terminal.
const COLUMNS: usize = 80;
/// Widths of a head that is broken into lines, if its words allow it.
const NARROW: usize = 8;
const NARROWEST: usize = 5;
/// Minimum width of a column of text that is broken into lines: some three words.
const TEXT: u16 = 24;
/// Widest column of names in front of values.
const NAMES: usize = 54;

/// Whether words are coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Paint {
    /// Uncoloured.
    #[default]
    Plain,
    /// In the terminal's own colours.
    Coloured,
}

impl Paint {
    fn verdict(self, verdict: Verdict, text: &str) -> String {
        let code = match verdict {
            Verdict::Good => 32,
            Verdict::Doubtful => 33,
            Verdict::Unusable => 31,
        };
        match self {
            Paint::Plain => text.to_owned(),
            Paint::Coloured => coloured_text(text, code),
        }
    }
}

impl Document {
    /// The document in lines of at most 80 columns.
    pub fn terminal(&self, paint: Paint) -> String {
        let mut text = String::new();
        write(&mut text, self, paint);
        text
    }
}

impl fmt::Display for Document {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.terminal(Paint::Plain))
    }
}

fn write(text: &mut String, document: &Document, paint: Paint) {
    let mut after_table = false;
    for block in &document.blocks {
        if matches!(block, Block::Section(section) if section.is_for_browsers()) {
            continue;
        }
        let separated = is_separated(block);
        // A heading is directly above its content.
        if (separated && !text.is_empty() && !text.ends_with(":\n") || after_table) && !text.ends_with("\n\n")
        {
            text.push('\n');
        }
        after_table = is_separated(block);
        match block {
            Block::Paragraph(words, tone) => text.push_str(&match tone {
                Tone::Verdict(verdict) => {
                    let lines = wrapped(words, COLUMNS, 2);
                    lines.lines().map(|line| paint.verdict(*verdict, line) + "\n").collect()
                }
                Tone::Plain | Tone::Strong => wrapped(words, COLUMNS, 2),
            }),
            Block::List { items, numbered } => {
                for (index, item) in items.iter().enumerate() {
                    let mark = if *numbered { format!("{}. ", index + 1) } else { String::new() };
                    text.push_str(&wrapped(&format!("  {mark}{item}"), COLUMNS, 4));
                }
            }
            Block::Facts(facts) => write_facts(text, facts),
            Block::Table(table) => {
                if !table.caption.is_empty() {
                    text.push_str(&wrapped(&table.caption, COLUMNS, 2));
                }
                text.push_str(&painted(table, paint));
                text.push('\n');
            }
            Block::Code(lines) => lines.lines().for_each(|line| text.push_str(&format!("  {line}\n"))),
            Block::Section(Section { heading, body, .. }) => {
                text.push_str(&format!("{heading}:\n"));
                write(text, body, paint);
            }
            Block::Figures { .. } | Block::Widget(_) => {}
        }
    }
}

fn is_separated(block: &Block) -> bool {
    matches!(block, Block::Table(_) | Block::Facts(_) | Block::Section(_))
}

fn write_facts(text: &mut String, facts: &Facts) {
    if !facts.caption.is_empty() {
        text.push_str(&wrapped(&facts.caption, COLUMNS, 2));
    }
    let longest = facts.rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let width = longest.min(NAMES) + 2;
    for (name, value) in &facts.rows {
        let lines = wrapped(value, COLUMNS - width, 0).replace('\n', &format!("\n{}", " ".repeat(width)));
        let name = format!("{name}  ");
        text.push_str(format!("{name:<width$}{}", lines.trim_end()).trim_end());
        text.push('\n');
    }
}

fn painted(table: &Table, paint: Paint) -> String {
    let verdicts = [Verdict::Good, Verdict::Doubtful, Verdict::Unusable];
    let cells = || table.rows.iter().flat_map(|row| &row.cells);
    let used = verdicts
        .into_iter()
        .filter(|verdict| cells().any(|cell| cell.look == Look::Verdict(*verdict) && !cell.text.is_empty()));
    used.fold(laid_out(table), |text, verdict| {
        text.replace(verdict_word(verdict), &paint.verdict(verdict, verdict_word(verdict)))
    })
}

/// A table in 80 columns: its heads are broken into lines, then its texts, then it continues below with its first column repeated.
fn laid_out(table: &Table) -> String {
    let every_column: Vec<usize> = (0..table.heads.len()).collect();
    let has_texts = table.texts.iter().skip(1).any(|is_text| *is_text);
    let mut widths = [COLUMNS, NARROW, NARROWEST].into_iter();
    let text =
        widths.find_map(|width| Some(lines(&columns(table, &every_column, width))).filter(|text| fits(text)));
    let broken =
        || Some(lines(&with_a_broken_text(table, &every_column))).filter(|text| has_texts && fits(text));
    text.or_else(broken).unwrap_or_else(|| split_into_parts(table).join("\n\n")) + "\n"
}

fn columns(table: &Table, shown: &[usize], head_columns: usize) -> Layout {
    let mut layout = Layout::new();
    let head = |column: &usize| wrapped(&table.heads[*column], head_columns, 0).trim_end().to_owned();
    layout.load_style(presets::NOTHING).set_header(shown.iter().map(head));
    for row in &table.rows {
        layout
            .add_row(shown.iter().map(|column| row.cells.get(*column).map_or("", |cell| cell.text.as_str())));
    }
    for (place, column) in shown.iter().enumerate() {
        let Some(laid_out) = layout.column_mut(place) else { continue };
        laid_out.set_padding((0, if head_columns <= NARROW { 1 } else { 2 }));
        if !table.texts[*column] {
            laid_out.set_cell_alignment(CellAlignment::Right);
        }
    }
    layout
}

/// The same with the widest of their texts, but not the first column, broken into lines.
fn with_a_broken_text(table: &Table, shown: &[usize]) -> Layout {
    let mut layout = columns(table, shown, NARROW);
    layout.set_content_arrangement(ContentArrangement::Dynamic).set_width(COLUMNS as u16);
    let width = |column: &usize| {
        let cells = table.rows.iter().filter_map(|row| row.cells.get(*column));
        cells.map(|cell| cell.text.chars().count()).max()
    };
    let texts = shown.iter().skip(1).filter(|column| table.texts[**column]);
    let widest = texts.max_by_key(|column| width(column)).copied();
    for (place, column) in shown.iter().enumerate() {
        let constraint = if Some(*column) == widest {
            ColumnConstraint::LowerBoundary(Width::Fixed(TEXT))
        } else {
            ColumnConstraint::ContentWidth
        };
        if let Some(laid_out) = layout.column_mut(place) {
            laid_out.set_constraint(constraint);
        }
    }
    layout
}

fn split_into_parts(table: &Table) -> Vec<String> {
    let part = |shown: &[usize]| {
        let text = lines(&columns(table, shown, NARROW));
        if fits(&text) { text } else { lines(&with_a_broken_text(table, shown)) }
    };
    let mut parts = Vec::new();
    let mut shown = vec![0];
    for column in 1..table.heads.len() {
        shown.push(column);
        if shown.len() > 2 && !fits(&lines(&columns(table, &shown, NARROW))) {
            shown.pop();
            parts.push(part(&shown));
            shown = vec![0, column];
        }
    }
    parts.push(part(&shown));
    parts
}

fn lines(layout: &Layout) -> String {
    layout.lines().map(|line| line.trim_end().to_owned()).collect::<Vec<_>>().join("\n")
}

fn fits(text: &str) -> bool {
    text.lines().all(|line| line.chars().count() <= COLUMNS)
}

/// Wraps text to `columns` if words allow it and ends the line; continuations are indented, and a number stays with its unit.
pub fn wrapped(text: &str, columns: usize, indent: usize) -> String {
    let mut lines = String::new();
    for line in text.lines() {
        // Keep the indentation of the text.
        let start = line.len() - line.trim_start().len();
        let mut length = start;
        lines.push_str(&line[..start]);
        for (index, phrases) in with_their_units(line).into_iter().enumerate() {
            let word = phrases.join(" ");
            let width = word.chars().count();
            if index > 0 && length + 1 + width > columns {
                lines.push('\n');
                lines.push_str(&" ".repeat(indent));
                length = indent;
            } else if index > 0 {
                lines.push(' ');
                length += 1;
            }
            lines.push_str(&word);
            length += width;
        }
        lines.push('\n');
    }
    lines
}

/// Longest word that is taken for a unit.
const UNIT: usize = 8;

/// The words of a line, each number together with the unit behind it.
fn with_their_units(line: &str) -> Vec<Vec<&str>> {
    let mut groups: Vec<Vec<&str>> = Vec::new();
    for word in line.split_whitespace() {
        let is_number = |word: &str| word.parse::<f64>().is_ok();
        let belongs = |last: &&str| {
            if is_number(word) { *last == "+/-" } else { is_number(last) && word.len() <= UNIT }
        };
        match groups.last_mut().filter(|group| group.last().is_some_and(belongs)) {
            Some(group) => group.push(word),
            None => groups.push(vec![word]),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_table_fits_and_keeps_every_cell() {
        let cells = |row: usize| (0..20).map(move |column| format!("{row}.{column:04}"));
        let heads = (0..20).map(|column| format!("quantity {column} in kg/s"));
        let text = laid_out(&Table::new(heads).rows((1..4).map(cells)));
        assert!(fits(&text), "{text}");
        assert!((1..4).flat_map(cells).all(|cell| text.contains(&cell)), "{text}");
    }

    #[test]
    fn a_long_text_is_broken_between_its_words() {
        let words = "a sentence of some twenty words that is much too long for a line of a terminal and goes on and on";
        let table = Table::new(["name", "value", "meaning"]).with_texts([2]).rows([["x", "12.5", words]]);
        let text = laid_out(&table);
        assert!(fits(&text) && text.contains("12.5"), "{text}");
        assert!(words.split(' ').all(|word| text.split_whitespace().any(|shown| shown == word)), "{text}");
    }

    #[test]
    fn a_name_of_any_length_is_apart_from_its_value() {
        let mut document = Document::default();
        document.facts("", [("short", "1 K".to_owned()), (&"long ".repeat(14), "2 K".to_owned())]);
        let text = document.to_string();
        assert!(text.lines().all(|line| line.ends_with("  1 K") || line.ends_with("  2 K")), "{text}");
    }

    #[test]
    fn no_line_is_longer_and_no_word_is_lost() {
        let text = "  a sentence of some words that goes on and on until it is over";
        let lines = wrapped(text, 20, 4);
        assert!(lines.lines().all(|line| line.chars().count() <= 20), "{lines}");
        assert!(lines.starts_with("  a sentence") && lines.lines().nth(1).unwrap().starts_with("    "));
        assert_eq!(lines.split_whitespace().collect::<Vec<_>>(), text.split_whitespace().collect::<Vec<_>>());
        assert_eq!(wrapped("unbreakable", 4, 2), "unbreakable\n");
        assert_eq!(
            wrapped("it takes about 1 h 11 min or +/- 0.5 %", 17, 0),
            "it takes about\n1 h 11 min or\n+/- 0.5 %\n"
        );
    }
}
