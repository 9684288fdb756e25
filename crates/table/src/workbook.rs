//! Sheets of Excel workbooks as rows of typed cells.

use crate::decimal_sign;
use crate::instant::{Instant, NS_PER_DAY};
use crate::xls::{Cell, Sheet, XLS_MAGIC, read_xls};
use crate::xlsx_limits::{XlsxLimits, check_xlsx};
use calamine::{DataRef, DataType, Reader, SheetVisible, Xlsx};
use jiff::ToSpan;
use jiff::civil::{Date, Time};
use std::io::{Read, Seek};

/// Maximum stored length of a cell's text, bytes. Bound: a name, a unit or a date is shorter.
const MAX_TEXT_BYTES: usize = 1 << 10;

/// Days from the origin of Excel's dates to 1970-01-01. Source: the calendar.
const EXCEL_EPOCH_DAYS: i64 = 25_569;

/// Maximum date of a log in days since Excel's origin. Bound: the year 2200.
const MAX_DAY: f64 = 109_940.0;

/// Maximum number of columns. Source: Excel's own limit.
const MAX_COLUMNS: usize = 16_384;

/// Whether a file that starts with these bytes may be a workbook: a compound file, or a zip archive.
pub fn is_workbook(head: &[u8]) -> bool {
    head.starts_with(&XLS_MAGIC) || head.starts_with(b"PK")
}

/// An open workbook.
pub enum Book<R> {
    /// Excel 2007 and later, read cell by cell.
    Xlsx(Box<Xlsx<R>>),
    /// Excel 97 to 2003, whose sheets fit into the memory.
    Xls(Vec<Sheet>),
}

type NextCell<'a> = Box<dyn FnMut() -> Result<Option<(u32, usize, Value)>, String> + 'a>;

impl<R: Read + Seek> Book<R> {
    /// Opens a workbook that unpacks within limits.
    pub fn open(mut file: R, limits: XlsxLimits) -> Result<Book<R>, String> {
        let mut head = [0; XLS_MAGIC.len()];
        let is_compound = file.read_exact(&mut head).is_ok() && head == XLS_MAGIC;
        file.rewind().map_err(|error| error.to_string())?;
        if is_compound {
            return Ok(Book::Xls(read_xls(file)?));
        }
        check_xlsx(&mut file, limits)?;
        file.rewind().map_err(|error| error.to_string())?;
        let book = Xlsx::new(file).map_err(|error| error.to_string())?;
        Ok(Book::Xlsx(Box::new(book)))
    }

    /// Names of all sheets, and whether they are hidden.
    pub fn sheets(&self) -> Vec<(String, bool)> {
        match self {
            Book::Xlsx(book) => {
                let sheets = book.sheets_metadata().iter();
                sheets.map(|sheet| (sheet.name.clone(), sheet.visible != SheetVisible::Visible)).collect()
            }
            Book::Xls(sheets) => sheets.iter().map(|sheet| (sheet.name.clone(), sheet.is_hidden)).collect(),
        }
    }

    /// The rows of a sheet; `None` if it has no cells, as charts do.
    pub fn rows(&mut self, name: &str) -> Option<SheetRows<'_>> {
        let cells: NextCell<'_> = match self {
            Book::Xlsx(book) => {
                let mut reader = book.worksheet_cells_reader(name).ok()?;
                // The reader fails after the last cell.
                let mut ended = false;
                Box::new(move || {
                    if ended {
                        return Ok(None);
                    }
                    let cell = reader.next_cell().map_err(|error| error.to_string())?;
                    ended = cell.is_none();
                    Ok(cell.map(|cell| {
                        let (row, column) = cell.get_position();
                        (row, usize::try_from(column).unwrap_or(usize::MAX), value_of(cell.get_value()))
                    }))
                })
            }
            Book::Xls(sheets) => {
                let mut cells = sheets.iter().find(|sheet| sheet.name == name)?.cells.iter();
                Box::new(move || {
                    Ok(cells.next().map(|(row, column, cell)| {
                        let value = match cell {
                            Cell::Number(value) => Value::Number(*value),
                            Cell::Days(days) => instant(*days),
                            Cell::Text(text) => Value::Text(truncated(text)),
                        };
                        (u32::from(*row), usize::from(*column), value)
                    }))
                })
            }
        };
        Some(SheetRows { cells, next: None, row: Vec::new(), at: 0 })
    }
}

/// The rows of a sheet; rows without any cell are skipped.
pub struct SheetRows<'a> {
    cells: NextCell<'a>,
    next: Option<(u32, usize, Value)>,
    row: Vec<Value>,
    at: usize,
}

impl SheetRows<'_> {
    /// Advances to the next row with a cell; `false` after the last one.
    pub fn advance(&mut self) -> Result<bool, String> {
        self.row.clear();
        let mut current = None;
        while let Some((row, column, value)) = self.next_cell()? {
            if current.is_some_and(|current| current != row) {
                self.next = Some((row, column, value));
                break;
            }
            if value.is_empty() || column > MAX_COLUMNS {
                continue;
            }
            current = Some(row);
            self.at = row as usize + 1;
            if self.row.len() <= column {
                self.row.resize(column + 1, Value::Empty);
            }
            if let Some(place) = self.row.get_mut(column) {
                *place = value;
            }
        }
        Ok(current.is_some())
    }

    fn next_cell(&mut self) -> Result<Option<(u32, usize, Value)>, String> {
        match self.next.take() {
            Some(cell) => Ok(Some(cell)),
            None => (self.cells)(),
        }
    }

    /// The cells of the row, from the first column of the sheet.
    #[inline]
    pub fn row(&self) -> &[Value] {
        &self.row
    }

    /// Number of the row in the sheet, from 1.
    pub fn number(&self) -> usize {
        self.at
    }
}

/// The contents of a cell.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "the names are the contents")]
pub enum Value {
    Empty,
    Number(f64),
    Text(String),
    Instant(Instant),
}

impl Value {
    /// Whether the cell has no content.
    pub fn is_empty(&self) -> bool {
        match self {
            Value::Empty => true,
            Value::Text(text) => text.is_empty(),
            _ => false,
        }
    }

    /// Size of its text, bytes; 0 of a number or date.
    pub fn text_bytes(&self) -> usize {
        if let Value::Text(text) = self { text.len() } else { 0 }
    }

    /// Size of the cell with its text, bytes.
    pub fn size(&self) -> usize {
        size_of::<Value>() + self.text_bytes()
    }

    /// Its text as in a cell of a text file.
    pub fn text(&self, decimal: u8) -> String {
        match self {
            Value::Empty => String::new(),
            Value::Number(value) if decimal == b',' => value.to_string().replace('.', ","),
            Value::Number(value) => value.to_string(),
            Value::Text(text) => text.clone(),
            Value::Instant(instant) => text_of(*instant).unwrap_or_default(),
        }
    }
}

fn text_of(instant: Instant) -> Option<String> {
    let ns = instant.ns_of_day?.rem_euclid(NS_PER_DAY);
    let second = ns / 1_000_000_000;
    let (hour, minute) = (i8::try_from(second / 3600).ok()?, i8::try_from(second / 60 % 60).ok()?);
    let time =
        Time::new(hour, minute, i8::try_from(second % 60).ok()?, i32::try_from(ns % 1_000_000_000).ok()?)
            .ok()?;
    let Some(day) = instant.day else { return Some(time.to_string()) };
    let date = Date::new(1970, 1, 1).ok()?.checked_add(day.days()).ok()?;
    Some(format!("{date} {time}"))
}

/// The decimal sign of the numbers that some rows store as text.
pub fn decimal_sign_of_cells(rows: &[Vec<Value>]) -> u8 {
    let texts = |row: &Vec<Value>| {
        row.iter().filter(|cell| matches!(cell, Value::Text(_))).map(|cell| cell.text(b'.')).collect()
    };
    decimal_sign(&rows.iter().map(texts).collect::<Vec<Vec<String>>>()).0
}

fn value_of(data: &DataRef<'_>) -> Value {
    match data {
        DataRef::DateTime(date) => instant(date.as_f64()),
        DataRef::String(text) | DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => {
            Value::Text(truncated(text))
        }
        DataRef::SharedString(text) => Value::Text(truncated(text)),
        data => data.as_f64().filter(|value| value.is_finite()).map_or(Value::Empty, Value::Number),
    }
}

/// The start of a text, which is stored.
fn truncated(text: &str) -> String {
    let text = text.trim();
    text.get(..text.floor_char_boundary(MAX_TEXT_BYTES)).unwrap_or_default().to_owned()
}

fn instant(days: f64) -> Value {
    instant_of(days).map_or(Value::Empty, Value::Instant)
}
/// Resolution of a time of a present-day date in Excel's days, ns. Bound: rounding of an f64.
const RESOLUTION_NS: i64 = 1000;

/// Excel's days since its origin; a value below one is a time of day.
fn instant_of(days: f64) -> Option<Instant> {
    if !(0.0..MAX_DAY).contains(&days) {
        return None;
    }
    let ns_of_day =
        ((days.fract() * NS_PER_DAY as f64) / RESOLUTION_NS as f64).round() as i64 * RESOLUTION_NS;
    let day = (days >= 1.0).then_some(days.trunc() as i64 - EXCEL_EPOCH_DAYS);
    Some(Instant { day, ns_of_day: Some(ns_of_day) })
}
