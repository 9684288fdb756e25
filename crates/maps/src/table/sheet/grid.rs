//! Cells of a table, from text of any encoding, separator and decimal sign, or from a sheet of a workbook.

use mapper_core::{ImportError, TextEncoding, is_missing_mark};

/// A row of cells.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GridRow {
    /// Line of the file or row of the sheet, from 1.
    pub(crate) at: usize,
    /// Cells without blanks around them.
    pub(crate) cells: Vec<String>,
    /// Whether it is a comment (`#`, `%`, `!`, `//`).
    pub(crate) is_comment: bool,
}

impl GridRow {
    /// All cells in one line.
    pub(crate) fn text(&self) -> String {
        self.cells.join(" ")
    }
}

/// Rows that are not blank.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    pub(crate) rows: Vec<GridRow>,
    /// Whether numbers have a decimal comma.
    pub(crate) has_decimal_comma: bool,
    /// Whether blanks separate the cells, so that no cell can be empty.
    pub(crate) is_blank_separated: bool,
    /// Thousands separator; `None` for a workbook, since its texts may have another decimal sign.
    thousands: Option<char>,
}

/// Maximum number of rows, as of points.
pub(crate) const MAX_ROWS: usize = crate::table::rows_to_lines::MAX_POINTS;
/// Maximum number of cells of a row: Excel's own limit.
pub(crate) const MAX_CELLS: usize = 16_384;

/// Maximum length of a line, bytes (16 for a cell), and number of lines that determine the separator. They limit the time for any text.
const MAX_LINE_BYTES: usize = 16 * MAX_CELLS;
const SEPARATOR_LINES: usize = 10_000;

/// Text in any encoding.
///
/// # Errors
/// [`ImportError::NotText`] if it has control characters, as other files have.
pub fn text_of(bytes: &[u8]) -> Result<String, ImportError> {
    let (encoding, mark) = TextEncoding::guess(bytes);
    let text = encoding.decode(bytes.get(mark..).unwrap_or_default());
    match text.find(|c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t' | '\u{c}')) {
        Some(at) => Err(ImportError::NotText { line: 1 + text[..at].matches('\n').count() }),
        None => Ok(text),
    }
}

impl Grid {
    /// The rows of a workbook.
    pub(crate) fn of_rows(rows: Vec<GridRow>) -> Grid {
        Grid { rows, has_decimal_comma: false, is_blank_separated: false, thousands: None }
    }

    /// Other rows with the same notation of numbers.
    pub(crate) fn with_rows(&self, rows: Vec<GridRow>) -> Grid {
        Grid { rows, is_blank_separated: false, ..*self }
    }

    /// The cells of a text.
    ///
    /// # Errors
    /// [`ImportError::TooMany`] if it has more rows than any map.
    pub(crate) fn of_text(text: &str) -> Result<Grid, ImportError> {
        let cut = |line: &'_ str| line.floor_char_boundary(MAX_LINE_BYTES);
        let lines = || text.lines().enumerate().map(|(index, line)| (index + 1, &line[..cut(line)]));
        if lines().nth(4 * MAX_ROWS).is_some() {
            return Err(ImportError::TooMany { line: 4 * MAX_ROWS, limit: MAX_ROWS });
        }
        let count = |separator: char| {
            lines()
                .take(SEPARATOR_LINES)
                .filter(|(_, line)| {
                    count_numbers(&split(split_comment(line).0, separator), separator != ',') >= 3
                })
                .count()
        };
        let separators = ['\t', ';', '|', ',', ' '];
        let most_rows = |count: &dyn Fn(char) -> usize| {
            let counts = separators.into_iter().map(|separator| (count(separator), separator));
            // Of equals the first wins.
            counts.rev().max_by_key(|(rows, _)| *rows).filter(|(rows, _)| *rows > 0)
        };
        // A column of text does not exclude a separator, except blanks, which occur in any text.
        let with_text = |separator: char| {
            let is_point = |line: &str| {
                separator != ' '
                    && count_number_cells(&split(split_comment(line).0, separator), separator != ',') >= 3
            };
            lines().take(SEPARATOR_LINES).filter(|(_, line)| is_point(line)).count()
        };
        let separator =
            most_rows(&count).or_else(|| most_rows(&with_text)).map_or(' ', |(_, separator)| separator);
        // Of cells between blanks, headings with blanks of their own are apart by at least two.
        let number_row = |line: &str| {
            let cells = split(split_comment(line).0, ' ');
            (count_numbers(&cells, true) >= 3).then_some(cells.len())
        };
        let width = lines().filter(|_| separator == ' ').find_map(|(_, line)| number_row(line));
        let mut rows = Vec::new();
        let mut decimal = [0, 0];
        for (at, line) in lines() {
            let (content, comment) = split_comment(line);
            for (text, is_comment) in [(content, false), (comment, true)] {
                let mut cells = split(text, separator);
                if width.is_some_and(|width| cells.len() > width) {
                    let wide = text.trim().split("  ").map(str::trim).filter(|cell| !cell.is_empty());
                    let wide: Vec<String> = wide.map(str::to_owned).collect();
                    cells = if Some(wide.len()) == width { wide } else { cells };
                }
                if cells.iter().all(|cell| !cell.contains(char::is_alphanumeric)) {
                    continue;
                }
                if rows.len() >= 2 * MAX_ROWS {
                    return Err(ImportError::TooMany { line: at, limit: MAX_ROWS });
                }
                for cell in &cells {
                    decimal[0] += usize::from(plain_number(cell).is_some() && cell.contains('.'));
                    decimal[1] += usize::from(comma_number(cell).is_some());
                }
                rows.push(GridRow { at, cells, is_comment });
            }
        }
        let has_decimal_comma = separator != ',' && decimal[1] > decimal[0];
        let thousands = Some(if has_decimal_comma { '.' } else { ',' });
        Ok(Grid { rows, has_decimal_comma, is_blank_separated: separator == ' ', thousands })
    }

    /// The cells with rows and columns exchanged; `None` for a table with more rows than quantities.
    pub(crate) fn transposed(&self) -> Option<Grid> {
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

    /// The cells as CSV.
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

    /// The number in a cell, which may have a blank after its sign; one with a percent sign as a fraction. `None` for empty cells and text.
    pub(crate) fn number(&self, cell: &str) -> Option<f64> {
        let cell = cell.replace('\u{2212}', "-").replace("- ", "-");
        let (text, factor) = match cell.strip_suffix('%') {
            Some(text) => (text.trim_end(), 0.01),
            None => (cell.as_str(), 1.0),
        };
        let thousands = self.thousands.and_then(|mark| without_thousands(text, mark));
        let text = thousands.as_deref().unwrap_or(text);
        let value = if self.has_decimal_comma {
            comma_number(text).or_else(|| plain_number(text))
        } else {
            plain_number(text)
        };
        value.or_else(|| comma_number(text)).map(|value| factor * value)
    }
}

fn split_comment(line: &str) -> (&str, &str) {
    let line = line.trim();
    // In a row of units `%` may be the unit of an efficiency.
    let is_unit = line.strip_prefix('%').is_some_and(|rest| rest.starts_with([',', ';', '\t']));
    let marks = ["!", "%", "//", "#"];
    if let Some(comment) = marks.iter().find_map(|mark| line.strip_prefix(mark)).filter(|_| !is_unit) {
        return ("", comment.trim_start_matches(['#', '!', '%', '/']).trim());
    }
    line.split_once('#').unwrap_or((line, ""))
}

/// Cells between separators. Between blanks, a unit in brackets belongs to the name before it.
fn split(line: &str, separator: char) -> Vec<String> {
    if separator != ' ' {
        let cell = |text: &str| {
            let text = text.trim().trim_matches('"').trim();
            // Blanks between thousands: `60 000`.
            let grouped =
                text.contains(char::is_whitespace) && text.starts_with(|c: char| c.is_ascii_digit());
            let groups = || text.split(char::is_whitespace).skip(1);
            let is_group = |group: &str| {
                let digits = group.find(|c: char| !c.is_ascii_digit()).unwrap_or(group.len());
                digits == 3 && group[digits..].chars().all(|c| c.is_ascii_digit() || ".,".contains(c))
            };
            if grouped && groups().all(is_group) {
                text.split_whitespace().collect()
            } else {
                text.to_owned()
            }
        };
        let mut cells = vec![String::new()];
        let mut quoted = false;
        for c in line.chars() {
            quoted ^= c == '"';
            let is_new = c == separator && !quoted && cells.len() < MAX_CELLS;
            match cells.last_mut() {
                Some(last) if !is_new => last.push(c),
                _ => cells.push(String::new()),
            }
        }
        return cells.iter().map(|text| cell(text)).collect();
    }
    let mut cells: Vec<String> = Vec::new();
    // `Speed 60,000 RPM`: a comma between thousands must not be a separator.
    let words = line.split_whitespace().flat_map(|word| match without_thousands(word, ',') {
        Some(_) => vec![word],
        None => word.split([',', ';']).collect(),
    });
    for word in words.filter(|word| !word.is_empty()) {
        // "0,14 1,105": a decimal comma must not be a separator.
        match cells.last_mut().filter(|_| word.starts_with(['[', '('])) {
            Some(name) => name.push_str(word),
            None => cells.push(word.to_owned()),
        }
    }
    let comma: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    if comma.iter().filter(|word| comma_number(word).is_some()).count() >= 2 { comma } else { cells }
}

pub(crate) fn count_number_cells(cells: &[String], has_decimal_comma: bool) -> usize {
    let is_number = |cell: &&String| count_numbers(std::slice::from_ref(*cell), has_decimal_comma) == 1;
    cells.iter().filter(is_number).count()
}

/// Number of cells that are numbers; 0 if any cell is text.
fn count_numbers(cells: &[String], has_decimal_comma: bool) -> usize {
    let bare = |cell: &str| cell.trim_end_matches('%').trim_end().to_owned();
    let number =
        |cell: &str| plain_number(cell).or_else(|| has_decimal_comma.then(|| comma_number(cell)).flatten());
    let filled: Vec<&String> = cells.iter().filter(|cell| !is_missing_mark(cell)).collect();
    if filled.iter().all(|cell| number(&bare(cell)).is_some()) { filled.len() } else { 0 }
}

fn plain_number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Removes thousands separators: `60.000` in a file with decimal commas, `60,000` in one with decimal points.
fn without_thousands(text: &str, mark: char) -> Option<String> {
    let decimal = if mark == '.' { ',' } else { '.' };
    let whole = text.split(decimal).next()?;
    let mut groups = whole.trim_start_matches(['-', '+']).split(mark);
    let is_digits = |group: &str| group.chars().all(|c| c.is_ascii_digit());
    let first = groups
        .next()
        .filter(|group| (1..=3).contains(&group.len()) && is_digits(group) && !group.starts_with('0'));
    let mut rest = groups.peekable();
    (first.is_some() && rest.peek().is_some() && rest.all(|group| group.len() == 3 && is_digits(group)))
        .then(|| text.replace(mark, ""))
}

fn comma_number(text: &str) -> Option<f64> {
    let comma = text.matches(',').count() == 1 && !text.contains('.');
    comma.then(|| plain_number(&text.replacen(',', ".", 1))).flatten()
}
