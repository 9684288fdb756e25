//! Excel workbooks: a table on each sheet.

mod check;

use crate::columns::table_head::COLUMN_LIMIT;
use crate::notation::instant::{Instant, NS_PER_DAY};
use crate::notation::number::number_in;
use crate::notation::separator::decimal;
use crate::notation::table_row::{Cells, Rows};
use crate::notation::typed_cell::Value;
use crate::tables::several_tables::{Part, side_by_side};
use crate::tables::table_log::{Origin, Table};
use calamine::{Cell, DataRef, DataType, Reader, SheetVisible, Xlsx, XlsxCellReader};
use mapper_recording::logs::{
    DateOrder, Layout, Log, LogError, LogFile, LogFormat, LogOptions, ReadSeek, Row, RowSink,
};

/// The format.
pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open };

const NAME: &str = "Excel";

/// Number of rows of a sheet in the sample.
const HEAD_ROWS: usize = 400;

/// Maximum text in its first rows, bytes.
const HEAD_BYTES: usize = 1 << 24;

/// Maximum stored length of a cell's text, bytes: a name, a unit or a date is shorter.
const TEXT_LIMIT: usize = 1 << 10;

/// Days from the origin of Excel's dates to 1970-01-01.
const EXCEL_EPOCH_DAYS: i64 = 25_569;

/// Maximum date of a log in days since Excel's origin: the year 2200.
const LAST_DAY: f64 = 109_940.0;

/// A zip file with the parts of a workbook; their contents are checked when it is opened.
fn recognises(head: &[u8]) -> bool {
    let holds = |part: &[u8]| head.windows(part.len()).any(|window| window == part);
    head.starts_with(b"PK\x03\x04") && (holds(b"[Content_Types]") || holds(b"xl/") || holds(b"docProps/"))
}

struct Workbook {
    file: LogFile,
    layout: Layout,
    sheets: Vec<Part>,
    /// Decimal sign of the numbers that each sheet stores as text.
    decimals: Vec<u8>,
}

fn failed(file: &LogFile) -> impl Fn(calamine::XlsxError) -> LogError + '_ {
    |error| file.content(NAME, error.to_string())
}

fn book(file: &LogFile) -> Result<Xlsx<Box<dyn ReadSeek>>, LogError> {
    Xlsx::new(file.open()?).map_err(failed(file))
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options.without(&["separator", "decimal", "encoding"]).map_err(|why| file.content(NAME, why))?;
    check::check(file)?;
    let mut book_of = book(file)?;
    let names: Vec<String> = book_of.sheet_names();
    let hidden = |name: &String| {
        book_of
            .sheets_metadata()
            .iter()
            .any(|sheet| sheet.name == *name && sheet.visible != SheetVisible::Visible)
    };
    // A hidden sheet is read only if it is named: it may hold an earlier state of the data.
    let (hidden, visible): (Vec<String>, Vec<String>) = names.iter().cloned().partition(hidden);
    let wanted = match &options.sheet {
        Some(sheet) => names.iter().filter(|name| *name == sheet).cloned().collect(),
        None => visible,
    };
    if let (Some(sheet), []) = (&options.sheet, wanted.as_slice()) {
        return Err(
            file.content(NAME, format!("it has no sheet `{sheet}`; its sheets are {}", names.join(", ")))
        );
    }
    let mut found: Vec<(String, Table, u8)> = Vec::new();
    let mut problems: Vec<String> = Vec::new();
    for name in wanted {
        let Ok(reader) = book_of.worksheet_cells_reader(&name) else { continue };
        let mut rows = SheetRows::new(file, reader, b'.');
        let mut cells: Vec<Vec<Value>> = Vec::new();
        let mut bytes = 0;
        while cells.len() < HEAD_ROWS && bytes < HEAD_BYTES && rows.advance()? {
            bytes += rows.row.iter().map(Value::size).sum::<usize>();
            cells.push(rows.row.clone());
        }
        if cells.is_empty() {
            continue;
        }
        // Numbers that are stored as text have a decimal sign.
        let texts = |row: &Vec<Value>| {
            row.iter().filter(|cell| matches!(cell, Value::Text(_))).map(|cell| cell.text(b'.')).collect()
        };
        let (decimal, _) = decimal(&cells.iter().map(texts).collect::<Vec<Vec<String>>>());
        let head: Vec<Vec<String>> =
            cells.iter().map(|row| row.iter().map(|cell| cell.text(decimal)).collect()).collect();
        match Table::look(&head, decimal, options, Origin::Rows) {
            Ok(mut table) => {
                note_empty_columns(&mut table, &head);
                found.push((name, table, decimal));
            }
            Err(problem) => problems.push(format!("sheet `{name}` is passed over: {problem}")),
        }
    }
    let decimals = found.iter().map(|(.., decimal)| *decimal).collect();
    let found = found.into_iter().map(|(name, table, _)| (name, table)).collect();
    if let (None, false) = (&options.sheet, hidden.is_empty()) {
        problems.push(format!("hidden, and read only if named by `sheet`: {}", hidden.join(", ")));
    }
    let (layout, sheets) = side_by_side("sheet", found, problems).map_err(|why| file.content(NAME, why))?;
    Ok(Box::new(Workbook { file: file.clone(), layout, sheets, decimals }))
}

impl Log for Workbook {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let mut book = book(&self.file)?;
        for (sheet, decimal) in self.sheets.iter().zip(&self.decimals) {
            let own = sheet.own(wanted);
            if own.is_empty() {
                continue;
            }
            let reader = book.worksheet_cells_reader(&sheet.name).map_err(failed(&self.file))?;
            let mut of_book = |row: Row<'_>| sheet.give(row, sink);
            let mut rows = SheetRows::new(&self.file, reader, *decimal);
            self.layout.add_finding(sheet.table.rows(&mut rows, &own, &mut of_book)?);
        }
        Ok(())
    }
}

/// Remarks columns with a name and no value: formulas that were never calculated.
fn note_empty_columns(table: &mut Table, head: &[Vec<String>]) {
    let empty = |column: usize| {
        head.iter().skip(table.data_row()).all(|row| row.get(column).is_none_or(String::is_empty))
    };
    let names = table.named_columns().filter(|(column, _)| empty(*column));
    let names: Vec<String> = names.map(|(_, name)| format!("`{name}`")).collect();
    if !names.is_empty() {
        table.layout.findings.push(format!(
            "{} without a value: formulas have none until a spreadsheet program has calculated and saved them",
            names.join(", ")
        ));
    }
}

/// A cell of a sheet.
fn value_of(data: &DataRef<'_>) -> Value {
    match data {
        DataRef::DateTime(date) => instant_of(date.as_f64()).map_or(Value::Empty, Value::Instant),
        DataRef::String(text) | DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => {
            Value::Text(start(text))
        }
        DataRef::SharedString(text) => Value::Text(start(text)),
        data => data.as_f64().filter(|value| value.is_finite()).map_or(Value::Empty, Value::Number),
    }
}

/// The stored start of a text.
fn start(text: &str) -> String {
    let text = text.trim();
    text.get(..text.floor_char_boundary(TEXT_LIMIT)).unwrap_or_default().to_owned()
}

/// Excel's days since its origin; a value below one is a time of day.
fn instant_of(days: f64) -> Option<Instant> {
    if !(0.0..LAST_DAY).contains(&days) {
        return None;
    }
    // To the microsecond: present-day dates have no finer resolution.
    let ns_of_day = ((days.fract() * NS_PER_DAY as f64) / 1e3).round() as i64 * 1000;
    let day = (days >= 1.0).then_some(days.trunc() as i64 - EXCEL_EPOCH_DAYS);
    Some(Instant { day, ns_of_day: Some(ns_of_day) })
}

/// The rows of a sheet; rows without any cell are skipped.
struct SheetRows<'a> {
    file: LogFile,
    reader: XlsxCellReader<'a, Box<dyn ReadSeek>>,
    /// The first cell of the next row.
    next: Option<(u32, usize, Value)>,
    /// Whether the last cell was read: the reader fails after it.
    ended: bool,
    row: Vec<Value>,
    decimal: u8,
}

impl<'a> SheetRows<'a> {
    fn new(file: &LogFile, reader: XlsxCellReader<'a, Box<dyn ReadSeek>>, decimal: u8) -> Self {
        SheetRows { file: file.clone(), reader, next: None, ended: false, row: Vec::new(), decimal }
    }

    fn next_cell(&mut self) -> Result<Option<(u32, usize, Value)>, LogError> {
        if let Some(cell) = self.next.take() {
            return Ok(Some(cell));
        }
        if self.ended {
            return Ok(None);
        }
        let cell: Option<Cell<DataRef<'_>>> = self.reader.next_cell().map_err(failed(&self.file))?;
        self.ended = cell.is_none();
        Ok(cell.map(|cell| {
            let (row, column) = cell.get_position();
            (row, usize::try_from(column).unwrap_or(usize::MAX), value_of(cell.get_value()))
        }))
    }
}

impl Cells for SheetRows<'_> {
    fn number(&self, column: usize) -> f64 {
        self.row.get(column).map_or(f64::NAN, |value| value.number(self.decimal))
    }

    fn number_in(&self, column: usize, unit: &str) -> f64 {
        match self.row.get(column) {
            Some(Value::Text(text)) => number_in(text, self.decimal, unit),
            // Some cells of such a column may hold the number alone.
            Some(value) => value.number(self.decimal),
            None => f64::NAN,
        }
    }

    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant> {
        self.row.get(column)?.instant(order)
    }
}

impl Rows for SheetRows<'_> {
    fn advance(&mut self) -> Result<bool, LogError> {
        self.row.clear();
        let mut current = None;
        while let Some((row, column, value)) = self.next_cell()? {
            if current.is_some_and(|current| current != row) {
                self.next = Some((row, column, value));
                break;
            }
            if value.is_empty() || column > COLUMN_LIMIT {
                continue;
            }
            current = Some(row);
            if self.row.len() <= column {
                self.row.resize(column + 1, Value::Empty);
            }
            if let Some(place) = self.row.get_mut(column) {
                *place = value;
            }
        }
        Ok(current.is_some())
    }
}
