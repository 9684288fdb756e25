//! The cells of a table: text of any encoding, separator and decimal sign, or a sheet of Excel.

use mapper_core::ImportError;
use std::io::{Cursor, Read};

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
    pub(crate) decimal_comma: bool,
    /// Whether blanks separate the cells: then none can be empty.
    pub(crate) by_blanks: bool,
}

/// Maximum number of rows, as of points.
const ROW_LIMIT: usize = crate::table::rows_to_lines::POINT_LIMIT;
/// Maximum number of cells of a row: Excel's own limit.
const CELL_LIMIT: usize = 16_384;

/// Maximum length of a line, bytes, 16 for a cell, and number of lines that show the separator. They bound the time for any text.
const LINE_LIMIT: usize = 16 * CELL_LIMIT;
const SHOWS_SEPARATOR: usize = 10_000;

/// Text in UTF-8, in UTF-16 with a byte order mark, or in Latin 1.
///
/// # Errors
/// [`ImportError::NotText`] if it has control characters, as other files have.
pub fn text_of(bytes: &[u8]) -> Result<String, ImportError> {
    let text = match bytes {
        [0xff, 0xfe, rest @ ..] if rest.len() % 2 == 0 => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] if rest.len() % 2 == 0 => utf16(rest, u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            // Spreadsheets begin their files with a byte order mark.
            Ok(text) => text.strip_prefix('\u{feff}').unwrap_or(text).to_owned(),
            Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
        },
    };
    match text.find(|c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t' | '\u{c}')) {
        Some(at) => Err(ImportError::NotText { line: 1 + text[..at].matches('\n').count() }),
        None => Ok(text),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks::<2>().0.iter().map(|pair| unit(*pair));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

impl Grid {
    /// The cells of a text.
    ///
    /// # Errors
    /// [`ImportError::TooMany`] if it has more rows than any map.
    pub(crate) fn of_text(text: &str) -> Result<Grid, ImportError> {
        let cut = |line: &'_ str| line.floor_char_boundary(LINE_LIMIT);
        let lines = || text.lines().enumerate().map(|(index, line)| (index + 1, &line[..cut(line)]));
        if lines().nth(4 * ROW_LIMIT).is_some() {
            return Err(ImportError::TooMany { line: 4 * ROW_LIMIT, limit: ROW_LIMIT });
        }
        let count = |separator: char| {
            lines()
                .take(SHOWS_SEPARATOR)
                .filter(|(_, line)| numbers(&split(uncommented(line).0, separator), separator != ',') >= 3)
                .count()
        };
        let separators = ['\t', ';', ',', ' '];
        let best = |count: &dyn Fn(char) -> usize| {
            let counts = separators.into_iter().map(|separator| (count(separator), separator));
            // The first of equal ones.
            counts.rev().max_by_key(|(rows, _)| *rows).filter(|(rows, _)| *rows > 0)
        };
        // A column of text leaves no row of numbers alone; between blanks it could be anything.
        let with_text = |separator: char| {
            let is_point = |line: &str| {
                separator != ' '
                    && some_numbers(&split(uncommented(line).0, separator), separator != ',') >= 3
            };
            lines().take(SHOWS_SEPARATOR).filter(|(_, line)| is_point(line)).count()
        };
        let separator = best(&count).or_else(|| best(&with_text)).map_or(' ', |(_, separator)| separator);
        let mut rows = Vec::new();
        let mut decimal = [0, 0];
        for (at, line) in lines() {
            let (content, comment) = uncommented(line);
            for (text, is_comment) in [(content, false), (comment, true)] {
                let cells = split(text, separator);
                if cells.iter().all(|cell| !cell.contains(char::is_alphanumeric)) {
                    continue;
                }
                if rows.len() >= 2 * ROW_LIMIT {
                    return Err(ImportError::TooMany { line: at, limit: ROW_LIMIT });
                }
                for cell in &cells {
                    decimal[0] += usize::from(plain_number(cell).is_some() && cell.contains('.'));
                    decimal[1] += usize::from(comma_number(cell).is_some());
                }
                rows.push(GridRow { at, cells, is_comment });
            }
        }
        Ok(Grid {
            rows,
            decimal_comma: separator != ',' && decimal[1] > decimal[0],
            by_blanks: separator == ' ',
        })
    }

    /// The cells of the first visible sheet with a table of numbers, or of the named one.
    ///
    /// # Errors
    /// [`ImportError::Workbook`] if it is not a workbook, unpacks to more than a map needs, or has no such sheet.
    pub(crate) fn of_workbook(bytes: &[u8], sheet: Option<&str>) -> Result<Grid, ImportError> {
        let failed = |error: &dyn std::fmt::Display| ImportError::Workbook { problem: error.to_string() };
        check_size(bytes)?;
        let mut book: calamine::Xlsx<_> =
            calamine::Reader::new(Cursor::new(bytes)).map_err(|error: calamine::XlsxError| failed(&error))?;
        let sheets = calamine::Reader::sheets_metadata(&book).to_vec();
        let list: Vec<&str> = sheets.iter().map(|sheet| sheet.name.as_str()).collect();
        let list = list.join(", ");
        // A hidden sheet counts only if it is named: people hide what they do not want to be used.
        let is_read = |known: &calamine::Sheet| match sheet {
            Some(name) => known.name == name,
            None => known.visible == calamine::SheetVisible::Visible,
        };
        for known in sheets.iter().filter(|known| is_read(known)) {
            let range = calamine::Reader::worksheet_range(&mut book, &known.name);
            let rows = rows_of_sheet(&range.map_err(|error| failed(&error))?);
            if rows.iter().filter(|row| some_numbers(&row.cells, true) >= 3).count() >= 2 {
                return Ok(Grid { rows, decimal_comma: false, by_blanks: false });
            }
        }
        let hidden: Vec<&str> = sheets
            .iter()
            .filter(|known| known.visible != calamine::SheetVisible::Visible)
            .map(|known| known.name.as_str())
            .collect();
        let which = sheet.map_or("no visible sheet".to_owned(), |name| format!("no sheet `{name}`"));
        let mut problem = format!("{which} holds rows of three numbers and more; sheets: {list}");
        if !hidden.is_empty() {
            problem += &format!("; hidden: {} (name one by `--with sheet=...`)", hidden.join(", "));
        }
        Err(ImportError::Workbook { problem })
    }

    /// The cells as CSV.
    pub(crate) fn csv(&self) -> String {
        let cell = |cell: &String| {
            let plain = cell.replace(['"', '\n', '\r'], " ");
            if plain.contains(',') { format!("\"{plain}\"") } else { plain }
        };
        let line = |row: &GridRow| row.cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\n";
        self.rows.iter().map(line).collect()
    }

    /// The number in a cell: with a percent sign as a fraction, with a blank behind its sign. `None` for an empty one and for text.
    pub(crate) fn number(&self, cell: &str) -> Option<f64> {
        let cell = cell.replace('\u{2212}', "-").replace("- ", "-");
        let (text, factor) = match cell.strip_suffix('%') {
            Some(text) => (text.trim_end(), 0.01),
            None => (cell.as_str(), 1.0),
        };
        let value = if self.decimal_comma {
            comma_number(text).or_else(|| plain_number(text))
        } else {
            plain_number(text)
        };
        value.or_else(|| comma_number(text)).map(|value| factor * value)
    }
}

/// The rows of a sheet that are not blank.
fn rows_of_sheet(range: &calamine::Range<calamine::Data>) -> Vec<GridRow> {
    let first = range.start().map_or(0, |(row, _)| row as usize);
    let cells = |row: &[calamine::Data]| {
        row.iter().take(CELL_LIMIT).map(|cell| cell.to_string().trim().to_owned()).collect::<Vec<String>>()
    };
    range
        .rows()
        .take(2 * ROW_LIMIT)
        .enumerate()
        .map(|(index, row)| GridRow { at: first + index + 1, cells: cells(row), is_comment: false })
        .filter(|row| row.cells.iter().any(|cell| cell.contains(char::is_alphanumeric)))
        .collect()
}

/// Largest size of everything in a workbook, bytes: 100 000 points with 20 columns of 30 bytes.
const UNPACKED_LIMIT: u64 = 64 << 20;

/// The library unpacks a workbook without a limit of its own, so the whole is unpacked once here and thrown away.
fn check_size(bytes: &[u8]) -> Result<(), ImportError> {
    let failed = |problem: String| ImportError::Workbook { problem };
    let mut parts = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|error| failed(error.to_string()))?;
    let mut left = UNPACKED_LIMIT;
    for index in 0..parts.len() {
        let part = parts.by_index(index).map_err(|error| failed(error.to_string()))?;
        let read = std::io::copy(&mut part.take(left + 1), &mut std::io::sink());
        let read = read.map_err(|error| failed(error.to_string()))?;
        if read > left {
            return Err(failed(format!(
                "it unpacks to more than {} MB; no map needs that",
                UNPACKED_LIMIT >> 20
            )));
        }
        left -= read;
    }
    Ok(())
}

/// Content and comment of a line.
fn uncommented(line: &str) -> (&str, &str) {
    let line = line.trim();
    // A row of units may begin with that of an efficiency.
    let is_unit = line.strip_prefix('%').is_some_and(|rest| rest.starts_with([',', ';', '\t']));
    let marks = ["!", "%", "//", "#"];
    if let Some(comment) = marks.iter().find_map(|mark| line.strip_prefix(mark)).filter(|_| !is_unit) {
        return ("", comment.trim_start_matches(['#', '!', '%', '/']).trim());
    }
    line.split_once('#').unwrap_or((line, ""))
}

/// Cells between separators; between blanks if the separator is one: then a unit in brackets belongs to the name before it.
fn split(line: &str, separator: char) -> Vec<String> {
    if separator != ' ' {
        let cell = |text: &str| text.trim().trim_matches('"').trim().to_owned();
        let mut cells = vec![String::new()];
        let mut quoted = false;
        for c in line.chars() {
            quoted ^= c == '"';
            let is_new = c == separator && !quoted && cells.len() < CELL_LIMIT;
            match cells.last_mut() {
                Some(last) if !is_new => last.push(c),
                _ => cells.push(String::new()),
            }
        }
        return cells.iter().map(|text| cell(text)).collect();
    }
    let mut cells: Vec<String> = Vec::new();
    for word in
        line.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';')).filter(|word| !word.is_empty())
    {
        // "0,14 1,105": a decimal comma must not be a separator.
        match cells.last_mut().filter(|_| word.starts_with(['[', '('])) {
            Some(name) => name.push_str(word),
            None => cells.push(word.to_owned()),
        }
    }
    let comma: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    if comma.iter().filter(|word| comma_number(word).is_some()).count() >= 2 { comma } else { cells }
}

/// How many cells are numbers, among others.
fn some_numbers(cells: &[String], decimal_comma: bool) -> usize {
    let is_number = |cell: &&String| numbers(std::slice::from_ref(*cell), decimal_comma) == 1;
    cells.iter().filter(is_number).count()
}

/// How many cells are numbers; 0 if one of them is text.
fn numbers(cells: &[String], decimal_comma: bool) -> usize {
    let bare = |cell: &str| cell.trim_end_matches('%').trim_end().to_owned();
    let number =
        |cell: &str| plain_number(cell).or_else(|| decimal_comma.then(|| comma_number(cell)).flatten());
    let filled: Vec<&String> = cells.iter().filter(|cell| !is_missing(cell)).collect();
    if filled.iter().all(|cell| number(&bare(cell)).is_some()) { filled.len() } else { 0 }
}

fn plain_number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// A number with a decimal comma.
fn comma_number(text: &str) -> Option<f64> {
    let comma = text.matches(',').count() == 1 && !text.contains('.');
    comma.then(|| plain_number(&text.replacen(',', ".", 1))).flatten()
}

/// Whether a cell stands for no value.
pub(crate) fn is_missing(cell: &str) -> bool {
    matches!(
        cell.to_ascii_lowercase().as_str(),
        "" | "-" | "--" | "---" | "n/a" | "na" | "nan" | "null" | "none" | "#n/a" | "\u{2013}"
    )
}
