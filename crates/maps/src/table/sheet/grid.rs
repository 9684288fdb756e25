//! Cells of a table, from text of any encoding, separator and decimal sign, or from a sheet of a workbook.

use mapper_core::ImportError;
use mapper_core::unit_factors::PERCENT;
use mapper_table::{
    Dialect, TextEncoding, TextRows, decimal_sign, detect_text, is_missing_mark, parse_number, typical_length,
};
use std::io::Cursor;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GridRow {
    /// Line of the file or row of the sheet, from 1.
    pub(crate) at: usize,
    pub(crate) cells: Vec<String>,
    /// Whether it is a comment (`#`, `%`, `!`, `//`).
    pub(crate) is_comment: bool,
}

impl GridRow {
    pub(crate) fn text(&self) -> String {
        self.cells.join(" ")
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    pub(crate) rows: Vec<GridRow>,
    pub(crate) has_decimal_comma: bool,
    /// Whether blanks separate the cells, so that no cell can be empty.
    pub(crate) is_blank_separated: bool,
}

/// Maximum number of rows, as of points.
pub(crate) const MAX_ROWS: usize = crate::table::rows_to_lines::MAX_POINTS;
/// Maximum number of cells of a row. Source: Excel's own limit.
pub(crate) const MAX_CELLS: usize = 16_384;

/// Maximum length of a line, bytes. Bound: 16 for each cell; limits the time for any text.
const MAX_LINE_BYTES: usize = 16 * MAX_CELLS;
/// Number of rows that determine the separator. Bound: effort.
const SEPARATOR_ROWS: usize = 1000;

/// Text in any encoding.
pub fn text_of(bytes: &[u8]) -> Result<String, ImportError> {
    let (encoding, mark) = TextEncoding::guess(bytes);
    let text = encoding.decode(bytes.get(mark..).unwrap_or_default());
    match text.find(|c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t' | '\u{c}')) {
        Some(at) => Err(ImportError::NotText { line: 1 + text[..at].matches('\n').count() }),
        None => Ok(text),
    }
}

impl Grid {
    /// The rows of a workbook, whose numbers have decimal points.
    pub(crate) fn of_rows(rows: Vec<GridRow>) -> Grid {
        Grid { rows, has_decimal_comma: false, is_blank_separated: false }
    }

    pub(crate) fn with_rows(&self, rows: Vec<GridRow>) -> Grid {
        Grid { rows, is_blank_separated: false, ..*self }
    }

    pub(crate) fn of_text(text: &str) -> Result<Grid, ImportError> {
        let too_many = |line| ImportError::TooMany { line, limit: MAX_ROWS };
        let (mut content, mut comments, mut comment_lines) = (String::new(), String::new(), Vec::new());
        for (index, line) in text.lines().enumerate() {
            if index >= 4 * MAX_ROWS {
                return Err(too_many(index));
            }
            let (cells, comment) = split_comment(&line[..line.floor_char_boundary(MAX_LINE_BYTES)]);
            content.push_str(cells);
            content.push('\n');
            if comment.contains(char::is_alphanumeric) {
                comments.push_str(comment);
                comments.push('\n');
                comment_lines.push(index + 1);
            }
        }
        let wrong = |error: std::io::Error| ImportError::Packed { problem: error.to_string() };
        let encoding = (TextEncoding::UTF_8, 0);
        let found = detect_text(content.as_bytes(), encoding, None, (SEPARATOR_ROWS, true)).map_err(wrong)?;
        let (separator, sample) = found.unwrap_or((b' ', Vec::new()));
        let dialect = Dialect { encoding: TextEncoding::UTF_8, mark: 0, separator, decimal: b'.' };
        let is_point = |row: &&Vec<String>| row.len() >= 3 && count_number_cells(row) == row.len();
        let width_of = || sample.iter().find(is_point).map_or_else(|| typical_length(&sample), Vec::len);
        let columns = Some(width_of());
        let width = columns.filter(|_| separator == b' ');
        let mut rows = Vec::new();
        let mut add = |text: String, is_comment: bool| -> Result<(), ImportError> {
            let text = if separator == b' ' { text.replace('\t', " ") } else { text };
            let mut cells_of = TextRows::new(Box::new(Cursor::new(text.into_bytes())), dialect);
            while cells_of.advance().map_err(wrong)? {
                let mut cells = cells_of.texts_below(width);
                cells.truncate(MAX_CELLS);
                let line = cells_of.line();
                let at = if is_comment { comment_lines.get(line - 1).copied().unwrap_or(line) } else { line };
                if cells.iter().any(|cell| cell.contains(char::is_alphanumeric)) {
                    rows.push(GridRow { at, cells, is_comment });
                }
                if rows.len() > 2 * MAX_ROWS {
                    return Err(too_many(at));
                }
            }
            Ok(())
        };
        add(content, false)?;
        add(comments, true)?;
        // `Data: N (rpm), m (kg/s), PR, eta` above cells with another separator, and `Units: rpm, kg/s, -, -`.
        for row in rows.iter_mut() {
            let text = row.text();
            let (title, list) = text.split_once(':').unwrap_or(("", text.as_str()));
            let is_units =
                ["unit", "einheit"].iter().any(|word| title.trim().to_lowercase().starts_with(word));
            let mark = [',', ';', '|'].into_iter().find(|mark| list.matches(*mark).count() >= 2);
            // `Reference: 298 K, 100 kPa, dry` has values.
            let has_value =
                |mark| list.split(mark).any(|name| name.trim().starts_with(|c: char| c.is_ascii_digit()));
            let mark = mark.filter(|mark| separator != *mark as u8 && (is_units || !has_value(*mark)));
            if let Some(mark) = mark.filter(|_| row.is_comment || is_units) {
                row.cells = list.split(mark).map(|name| name.trim().to_owned()).collect();
            } else if row.is_comment && separator != b' ' && Some(text.split_whitespace().count()) == columns
            {
                row.cells = text.split_whitespace().map(str::to_owned).collect();
            }
        }
        rows.sort_by_key(|row| (row.at, row.is_comment));
        let numbers: Vec<Vec<String>> =
            rows.iter().filter(|row| !row.is_comment).map(|row| row.cells.clone()).collect();
        let has_decimal_comma = decimal_sign(&numbers).0 == b',';
        Ok(Grid { rows, has_decimal_comma, is_blank_separated: separator == b' ' })
    }

    /// The cells with rows and columns exchanged; `None` for a table with more rows than quantities.
    pub(crate) fn transposed(&self) -> Option<Grid> {
        /// Bound: a map of all quantities of a point, with as many statistics.
        const MAX_QUANTITIES: usize = 100;
        let rows: Vec<&GridRow> = self.rows.iter().filter(|row| !row.is_comment).collect();
        let width = rows.iter().map(|row| row.cells.len()).max().filter(|_| rows.len() <= MAX_QUANTITIES)?;
        let cell = |row: &&GridRow, column: usize| row.cells.get(column).cloned().unwrap_or_default();
        let transposed_row = |column: usize| GridRow {
            at: column + 1,
            cells: rows.iter().map(|row| cell(row, column)).collect(),
            is_comment: false,
        };
        Some(Grid { rows: (0..width).map(transposed_row).collect(), ..*self })
    }

    pub(crate) fn csv(&self) -> String {
        let cell = |cell: &String| {
            // In a file with decimal points, the comma of such a text would separate thousands.
            let number = self.number(cell).filter(|_| cell.contains(',') && !cell.contains('%'));
            let plain =
                number.map_or_else(|| cell.replace(['"', '\n', '\r'], " "), |number| number.to_string());
            if plain.contains(',') { format!("\"{plain}\"") } else { plain }
        };
        let line = |row: &GridRow| row.cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\n";
        self.rows.iter().map(line).collect()
    }

    /// The first two numbers of every row.
    pub(crate) fn places(&self) -> Vec<[f64; 2]> {
        let place = |row: &GridRow| Some([self.number(row.cells.first()?)?, self.number(row.cells.get(1)?)?]);
        self.rows.iter().filter_map(place).collect()
    }

    /// The number in a cell; one with a percent sign as a fraction. `None` for empty cells and text.
    pub(crate) fn number(&self, cell: &str) -> Option<f64> {
        let (text, factor) = match cell.strip_suffix('%') {
            Some(text) => (text, 1.0 / PERCENT),
            None => (cell, 1.0),
        };
        let (usual, other) = if self.has_decimal_comma { (b',', b'.') } else { (b'.', b',') };
        let value = parse_number(text.as_bytes(), usual).or_else(|| parse_number(text.as_bytes(), other));
        value.map(|value| factor * value)
    }
}

fn split_comment(line: &str) -> (&str, &str) {
    // Between tabs the first cell may be empty.
    let is_indented = !line.trim().contains('\t');
    let line = if is_indented { line.trim() } else { line.trim_end().trim_start_matches(' ') };
    // In a row of units `%` may be the unit of an efficiency.
    let is_unit = line.strip_prefix('%').is_some_and(|rest| rest.starts_with([',', ';', '\t']));
    let marks = ["!", "%", "//", "#"];
    if let Some(comment) = marks.iter().find_map(|mark| line.strip_prefix(mark)).filter(|_| !is_unit) {
        return ("", comment.trim_start_matches(['#', '!', '%', '/']).trim());
    }
    line.split_once('#').unwrap_or((line, ""))
}

pub(crate) fn count_number_cells(cells: &[String]) -> usize {
    let grid = Grid::of_rows(Vec::new());
    cells.iter().filter(|cell| !is_missing_mark(cell) && grid.number(cell).is_some()).count()
}
