//! Tables for a terminal, numbers to the right, units in the head.

use crate::formatting::wrapped::wrapped;
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, Width, presets};
use std::fmt;

/// Columns of a terminal.
pub(crate) const COLUMNS: usize = 80;
/// Widths of a head that is broken into lines, if its words allow it.
const NARROW: usize = 8;
const NARROWEST: usize = 5;
/// Minimum width of a column of text that is broken into lines: some three words.
const TEXT: u16 = 24;

/// A table that fits 80 columns. If it is too wide, its heads are broken into lines, then its texts; a table that is still too wide
/// continues below itself, with its first column repeated.
#[derive(Debug, Clone)]
pub struct TextTable {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
    texts: Vec<usize>,
}

/// A table with these column heads; all columns but the first are numbers.
pub fn with_heads<H: AsRef<str>>(heads: &[H]) -> TextTable {
    TextTable {
        heads: heads.iter().map(|head| head.as_ref().to_owned()).collect(),
        rows: Vec::new(),
        texts: vec![0],
    }
}

impl TextTable {
    pub fn add_row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The same table with text in these columns.
    pub fn with_texts(mut self, columns: impl IntoIterator<Item = usize>) -> Self {
        self.texts.extend(columns);
        self
    }

    /// The columns side by side, each as wide as its content.
    fn laid_out(&self, columns: &[usize], head_columns: usize) -> Table {
        let mut table = Table::new();
        let head = |column: &usize| wrapped(&self.heads[*column], head_columns, 0).trim_end().to_owned();
        table.load_style(presets::NOTHING).set_header(columns.iter().map(head));
        for row in &self.rows {
            table.add_row(columns.iter().map(|column| row.get(*column).map_or("", String::as_str)));
        }
        for (place, column) in columns.iter().enumerate() {
            let Some(laid_out) = table.column_mut(place) else { continue };
            laid_out.set_padding((0, if head_columns <= NARROW { 1 } else { 2 }));
            if !self.texts.contains(column) {
                laid_out.set_cell_alignment(CellAlignment::Right);
            }
        }
        table
    }

    /// The same columns with the widest of their texts, but not the first column, broken into lines.
    fn with_a_broken_text(&self, columns: &[usize]) -> Table {
        let mut table = self.laid_out(columns, NARROW);
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(COLUMNS as u16);
        let width = |column: &usize| {
            self.rows.iter().filter_map(|row| row.get(*column)).map(|cell| cell.chars().count()).max()
        };
        let texts = columns.iter().skip(1).filter(|column| self.texts.contains(*column));
        let widest = texts.max_by_key(|column| width(column)).copied();
        for (place, column) in columns.iter().enumerate() {
            let constraint = if Some(*column) == widest {
                ColumnConstraint::LowerBoundary(Width::Fixed(TEXT))
            } else {
                ColumnConstraint::ContentWidth
            };
            if let Some(laid_out) = table.column_mut(place) {
                laid_out.set_constraint(constraint);
            }
        }
        table
    }

    /// As many columns as fit, below each other.
    fn split_into_parts(&self) -> Vec<String> {
        let part = |columns: &[usize]| {
            let text = lines(&self.laid_out(columns, NARROW));
            if fits(&text) { text } else { lines(&self.with_a_broken_text(columns)) }
        };
        let mut parts = Vec::new();
        let mut columns = vec![0];
        for column in 1..self.heads.len() {
            columns.push(column);
            if columns.len() > 2 && !fits(&lines(&self.laid_out(&columns, NARROW))) {
                columns.pop();
                parts.push(part(&columns));
                columns = vec![0, column];
            }
        }
        parts.push(part(&columns));
        parts
    }
}

fn lines(table: &Table) -> String {
    table.lines().map(|line| line.trim_end().to_owned()).collect::<Vec<_>>().join("\n")
}

fn fits(text: &str) -> bool {
    text.lines().all(|line| line.chars().count() <= COLUMNS)
}

impl fmt::Display for TextTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let every_column: Vec<usize> = (0..self.heads.len()).collect();
        let has_texts = self.texts.iter().any(|column| *column > 0);
        let widths = [COLUMNS, NARROW, NARROWEST].into_iter();
        let text = widths.map(|width| lines(&self.laid_out(&every_column, width))).find(|text| fits(text));
        let broken =
            || Some(lines(&self.with_a_broken_text(&every_column))).filter(|text| has_texts && fits(text));
        f.write_str(&text.or_else(broken).unwrap_or_else(|| self.split_into_parts().join("\n\n")))
    }
}

#[cfg(test)]
mod tests {
    use super::{fits, with_heads};

    #[test]
    fn a_wide_table_fits_and_keeps_every_cell() {
        let heads: Vec<String> = (0..20).map(|column| format!("quantity {column} in kg/s")).collect();
        let cells = |row: usize| (0..20).map(move |column| format!("{row}.{column:04}"));
        let mut table = with_heads(&heads);
        (1..4).for_each(|row| table.add_row(cells(row)));
        let text = table.to_string();
        assert!(fits(&text), "{text}");
        assert!((1..4).flat_map(cells).all(|cell| text.contains(&cell)), "{text}");
    }

    #[test]
    fn a_long_text_is_broken_between_its_words() {
        let words = "a sentence of some twenty words that is much too long for a line of a terminal and goes on and on";
        let mut table = with_heads(&["name", "value", "meaning"]).with_texts([2]);
        table.add_row(["x".to_owned(), "12.5".to_owned(), words.to_owned()]);
        let text = table.to_string();
        assert!(fits(&text) && text.contains("12.5"), "{text}");
        assert!(words.split(' ').all(|word| text.split_whitespace().any(|shown| shown == word)), "{text}");
    }
}
