//! Excel workbooks, with a table on each sheet.

use crate::columns::sample::HEAD_ROWS;
use crate::columns::table_head::MAX_COLUMNS;
use crate::notation::instant::{Instant, NS_PER_DAY};
use crate::notation::separator::decimal;
use crate::notation::table_row::{Cell, Cells, Rows};
use crate::notation::typed_cell::Value;
use crate::tables::joined_tables::{Part, join_tables};
use crate::tables::table_log::{Origin, Table};
use calamine::{DataRef, DataType, Reader, SheetVisible, Xlsx};
use mapper_recording::logs::limits::{max_memory_bytes, max_unpacked_bytes};
use mapper_recording::logs::{
    Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, ReadSeek, Row, RowSink,
};
use mapper_workbook::{XlsxLimits, check_xlsx};

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open };

const NAME: &str = "Excel";

/// Maximum size of the text in the sample, bytes.
const HEAD_BYTES: usize = 1 << 24;

/// Maximum stored length of a cell's text, bytes: a name, a unit or a date is shorter.
const MAX_TEXT_BYTES: usize = 1 << 10;

/// Days from the origin of Excel's dates to 1970-01-01.
const EXCEL_EPOCH_DAYS: i64 = 25_569;

/// Maximum date of a log in days since Excel's origin: the year 2200.
const MAX_DAY: f64 = 109_940.0;

/// A zip file with the parts of a workbook, or a compound file; their contents are checked when it is opened.
fn recognises(head: &[u8]) -> bool {
    let holds = |part: &[u8]| head.windows(part.len()).any(|window| window == part);
    head.starts_with(&mapper_workbook::MAGIC)
        || (head.starts_with(b"PK\x03\x04")
            && (holds(b"[Content_Types]") || holds(b"xl/") || holds(b"docProps/")))
}

struct Workbook {
    file: LogFile,
    layout: Layout,
    sheets: Vec<Part>,
    /// Decimal sign of the numbers that each sheet stores as text.
    decimals: Vec<u8>,
}

enum Book {
    /// Excel 2007 and later, read cell by cell.
    Xlsx(Box<Xlsx<Box<dyn ReadSeek>>>),
    /// Excel 97 to 2003, whose sheets fit into the memory.
    Xls(Vec<mapper_workbook::Sheet>),
}

/// The next cell with its row and column.
type NextCell<'a> = Box<dyn FnMut() -> Result<Option<(u32, usize, Value)>, LogError> + 'a>;

impl Book {
    fn open(file: &LogFile) -> Result<Book, LogError> {
        if file.head(mapper_workbook::MAGIC.len())? == mapper_workbook::MAGIC {
            let sheets =
                mapper_workbook::read_xls(file.open()?).map_err(|why| file.content_error(NAME, why))?;
            return Ok(Book::Xls(sheets));
        }
        let size_bytes = file.size_bytes()?;
        let limits = XlsxLimits {
            unpacked_bytes: max_unpacked_bytes(size_bytes),
            memory_bytes: max_memory_bytes(size_bytes),
        };
        check_xlsx(file.open()?, limits).map_err(|why| file.content_error(NAME, why))?;
        let book = Xlsx::new(file.open()?);
        book.map(|book| Book::Xlsx(Box::new(book)))
            .map_err(|error| file.content_error(NAME, error.to_string()))
    }

    /// Names of all sheets, and whether they are hidden.
    fn sheets(&self) -> Vec<(String, bool)> {
        match self {
            Book::Xlsx(book) => {
                let sheets = book.sheets_metadata().iter();
                sheets.map(|sheet| (sheet.name.clone(), sheet.visible != SheetVisible::Visible)).collect()
            }
            Book::Xls(sheets) => sheets.iter().map(|sheet| (sheet.name.clone(), sheet.is_hidden)).collect(),
        }
    }

    /// The cells of a sheet by row; `None` if it has none, as charts do.
    fn cells<'a>(&'a mut self, file: &'a LogFile, name: &str) -> Option<NextCell<'a>> {
        match self {
            Book::Xlsx(book) => {
                let mut reader = book.worksheet_cells_reader(name).ok()?;
                // The reader fails after the last cell.
                let mut ended = false;
                Some(Box::new(move || {
                    if ended {
                        return Ok(None);
                    }
                    let cell =
                        reader.next_cell().map_err(|error| file.content_error(NAME, error.to_string()))?;
                    ended = cell.is_none();
                    Ok(cell.map(|cell| {
                        let (row, column) = cell.get_position();
                        (row, usize::try_from(column).unwrap_or(usize::MAX), value_of(cell.get_value()))
                    }))
                }))
            }
            Book::Xls(sheets) => {
                let mut cells = sheets.iter().find(|sheet| sheet.name == name)?.cells.iter();
                Some(Box::new(move || {
                    Ok(cells.next().map(|(row, column, cell)| {
                        let value = match cell {
                            mapper_workbook::Cell::Number(value) => Value::Number(*value),
                            mapper_workbook::Cell::Days(days) => instant(*days),
                            mapper_workbook::Cell::Text(text) => Value::Text(truncated(text)),
                        };
                        (u32::from(*row), usize::from(*column), value)
                    }))
                }))
            }
        }
    }
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options
        .refuse_keys(&["separator", "decimal", "encoding"])
        .map_err(|why| file.content_error(NAME, why))?;
    let mut book = Book::open(file)?;
    let sheets = book.sheets();
    let names: Vec<&str> = sheets.iter().map(|(name, _)| name.as_str()).collect();
    if let Some(sheet) = options.sheet.as_ref().filter(|sheet| !names.contains(&sheet.as_str())) {
        return Err(file
            .content_error(NAME, format!("it has no sheet `{sheet}`; its sheets are {}", names.join(", "))));
    }
    let is_wanted = |name: &str, of_hidden: bool, is_hidden: bool| match &options.sheet {
        Some(sheet) => sheet == name,
        None => of_hidden == is_hidden,
    };
    let mut found: Vec<(String, Table, u8)> = Vec::new();
    let mut problems: Vec<LogFinding> = Vec::new();
    let hidden: Vec<&str> =
        sheets.iter().filter(|(_, hidden)| *hidden).map(|(name, _)| name.as_str()).collect();
    // A hidden sheet may have obsolete data: it is read only if it is named, or no visible one has a table.
    for of_hidden in [false, true] {
        if !found.is_empty() {
            break;
        }
        for (name, _) in sheets.iter().filter(|(name, hidden)| is_wanted(name, of_hidden, *hidden)) {
            let Some(cells) = book.cells(file, name) else { continue };
            match head_of(SheetRows::new(cells, b'.'), options)? {
                Some(Ok((table, decimal))) => found.push((name.clone(), table, decimal)),
                Some(Err(problem)) => problems.push(LogFinding::skipped("sheet", name, problem)),
                None => {}
            }
        }
        if options.sheet.is_some() {
            break;
        }
        if of_hidden && found.len() > 1 {
            found.clear();
            problems.push(LogFinding::SeveralHidden);
        }
    }
    if let (None, false) = (&options.sheet, hidden.is_empty()) {
        let is_read = found.iter().any(|(name, ..)| hidden.contains(&name.as_str()));
        let sheets = hidden.iter().map(|name| (*name).to_owned()).collect();
        problems.push(LogFinding::HiddenSheets { sheets, is_read });
    }
    let decimals = found.iter().map(|(.., decimal)| *decimal).collect();
    let found = found.into_iter().map(|(name, table, _)| (name, table)).collect();
    let (layout, sheets) =
        join_tables("sheet", found, problems).map_err(|why| file.content_error(NAME, why))?;
    Ok(Box::new(Workbook { file: file.clone(), layout, sheets, decimals }))
}

/// The table of a sheet and the decimal sign of its texts, or why there is none; `None` for an empty sheet.
type SheetHead = Option<Result<(Table, u8), String>>;

fn head_of(mut rows: SheetRows<'_>, options: &LogOptions) -> Result<SheetHead, LogError> {
    let mut cells: Vec<Vec<Value>> = Vec::new();
    let mut bytes = 0;
    while cells.len() < HEAD_ROWS && bytes < HEAD_BYTES && rows.advance()? {
        bytes += rows.row.iter().map(Value::size).sum::<usize>();
        cells.push(rows.row.clone());
    }
    if cells.is_empty() {
        return Ok(None);
    }
    // Numbers that are stored as text have a decimal sign.
    let texts = |row: &Vec<Value>| {
        row.iter().filter(|cell| matches!(cell, Value::Text(_))).map(|cell| cell.text(b'.')).collect()
    };
    let (decimal, _) = decimal(&cells.iter().map(texts).collect::<Vec<Vec<String>>>());
    let head: Vec<Vec<String>> =
        cells.iter().map(|row| row.iter().map(|cell| cell.text(decimal)).collect()).collect();
    let table = Table::analyse(&head, decimal, options, Origin::Rows);
    Ok(Some(table.map(|mut table| {
        note_empty_columns(&mut table, &head);
        (table, decimal)
    })))
}

impl Log for Workbook {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let mut book = Book::open(&self.file)?;
        for (sheet, decimal) in self.sheets.iter().zip(&self.decimals) {
            let own = sheet.own(wanted);
            if own.is_empty() {
                continue;
            }
            let Some(cells) = book.cells(&self.file, &sheet.name) else { continue };
            let mut of_book = |row: Row<'_>| sheet.forward_row(row, sink);
            let mut rows = SheetRows::new(cells, *decimal);
            self.layout.add_finding(sheet.table.rows(&mut rows, &own, &mut of_book)?);
        }
        Ok(())
    }
}

/// Adds a remark about columns with a name and no value, i.e. formulas that were never calculated.
fn note_empty_columns(table: &mut Table, head: &[Vec<String>]) {
    let empty = |column: usize| {
        head.iter().skip(table.data_row()).all(|row| row.get(column).is_none_or(String::is_empty))
    };
    // Empty columns between tables have no name either.
    let named = |column: usize| {
        head.iter().take(table.data_row()).any(|row| row.get(column).is_some_and(|cell| !cell.is_empty()))
    };
    let names = table.named_columns().filter(|(column, _)| named(*column) && empty(*column));
    let columns: Vec<String> = names.map(|(_, name)| name.to_owned()).collect();
    if !columns.is_empty() {
        table.layout.findings.push(LogFinding::WithoutValues { columns });
    }
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

/// Excel's days since its origin; a value below one is a time of day.
fn instant_of(days: f64) -> Option<Instant> {
    if !(0.0..MAX_DAY).contains(&days) {
        return None;
    }
    // To the microsecond, the resolution of an f64 of a present-day date.
    let ns_of_day = ((days.fract() * NS_PER_DAY as f64) / 1e3).round() as i64 * 1000;
    let day = (days >= 1.0).then_some(days.trunc() as i64 - EXCEL_EPOCH_DAYS);
    Some(Instant { day, ns_of_day: Some(ns_of_day) })
}

/// The rows of a sheet; rows without any cell are skipped.
struct SheetRows<'a> {
    cells: NextCell<'a>,
    /// The first cell of the next row.
    next: Option<(u32, usize, Value)>,
    row: Vec<Value>,
    decimal: u8,
}

impl<'a> SheetRows<'a> {
    fn new(cells: NextCell<'a>, decimal: u8) -> Self {
        SheetRows { cells, next: None, row: Vec::new(), decimal }
    }

    fn next_cell(&mut self) -> Result<Option<(u32, usize, Value)>, LogError> {
        match self.next.take() {
            Some(cell) => Ok(Some(cell)),
            None => (self.cells)(),
        }
    }
}

impl Cells for SheetRows<'_> {
    fn cell(&self, column: usize) -> Cell<'_> {
        match self.row.get(column) {
            Some(Value::Number(value)) => Cell::Number(*value),
            Some(Value::Text(text)) => Cell::Text(text.as_bytes()),
            Some(Value::Instant(instant)) => Cell::Instant(*instant),
            Some(Value::Empty) | None => Cell::Empty,
        }
    }

    fn decimal(&self) -> u8 {
        self.decimal
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
            if value.is_empty() || column > MAX_COLUMNS {
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
