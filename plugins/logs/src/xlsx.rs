//! Workbooks of Excel: a table on each sheet.

use crate::cells::{Cells, Rows};
use crate::instant::{Instant, NS_PER_DAY, parse_instant};
use crate::number::parse_number;
use crate::table_head::COLUMN_LIMIT;
use crate::table_log::Table;
use calamine::{Cell, DataRef, DataType, Reader, Xlsx, XlsxCellReader};
use jiff::ToSpan;
use jiff::civil::{Date, Time};
use mapper_logs::{DateOrder, Layout, Log, LogError, LogFile, LogFormat, LogOptions, ReadSeek, Row, RowSink};
use std::io::{self, Read as _};

/// The format.
pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open };

const NAME: &str = "Excel";

/// How many rows of a sheet are looked at.
const HEAD_ROWS: usize = 400;

/// Largest part of a workbook beside its sheets, unpacked, bytes: all of it is held in memory.
const PART_LIMIT: u64 = 128 << 20;

/// Largest sheet, unpacked, bytes: that of a million rows with 40 columns.
const SHEET_LIMIT: u64 = 4 << 30;

/// Days from the origin of Excel's dates to 1970-01-01.
const EXCEL_EPOCH_DAYS: i64 = 25_569;

/// Days since Excel's origin that are no dates of a log any more: the year 2200.
const LAST_DAY: f64 = 109_940.0;

/// A zip file with the parts of a workbook; what they are shows when it is opened.
fn recognises(head: &[u8]) -> bool {
    let holds = |part: &[u8]| head.windows(part.len()).any(|window| window == part);
    head.starts_with(b"PK\x03\x04") && (holds(b"[Content_Types]") || holds(b"xl/") || holds(b"docProps/"))
}

struct Workbook {
    file: LogFile,
    layout: Layout,
    /// Name and table of each sheet that has one, with its first group and its first column.
    sheets: Vec<Sheet>,
}

struct Sheet {
    name: String,
    table: Table,
    first_group: usize,
    first_column: usize,
}

fn failed(file: &LogFile) -> impl Fn(calamine::XlsxError) -> LogError + '_ {
    |error| file.content(NAME, error.to_string())
}

fn book(file: &LogFile) -> Result<Xlsx<Box<dyn ReadSeek>>, LogError> {
    Xlsx::new(file.open()?).map_err(failed(file))
}

/// Refuses what would unpack to more than there is memory for.
fn check_size(file: &LogFile) -> Result<(), LogError> {
    let wrong = |error: zip::result::ZipError| file.content(NAME, error.to_string());
    let mut archive = zip::ZipArchive::new(file.open()?).map_err(wrong)?;
    for index in 0..archive.len() {
        let part = archive.by_index(index).map_err(wrong)?;
        let (name, declared) = (part.name().map_err(wrong)?.into_owned(), part.size());
        let sheet = name.starts_with("xl/worksheets/sheet");
        let limit = if sheet { SHEET_LIMIT } else { PART_LIMIT };
        // Sheets are read piece by piece: what they declare is enough. The others are unpacked once to be sure.
        let size = if sheet { declared } else { io::copy(&mut part.take(limit + 1), &mut io::sink()).map_err(|error| file.error(error))? };
        if size > limit {
            return Err(file.content(NAME, format!("{name} unpacks to more than {} MiB", limit >> 20)));
        }
    }
    Ok(())
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    check_size(file)?;
    let mut book_of = book(file)?;
    let names: Vec<String> = book_of.sheet_names();
    let wanted: Vec<String> = names.iter().filter(|name| options.sheet.as_ref().is_none_or(|sheet| sheet == *name)).cloned().collect();
    if let (Some(sheet), []) = (&options.sheet, wanted.as_slice()) {
        return Err(file.content(NAME, format!("it has no sheet `{sheet}`; its sheets are {}", names.join(", "))));
    }
    let mut found: Vec<(String, Table)> = Vec::new();
    let mut problems: Vec<String> = Vec::new();
    for name in wanted {
        let Ok(reader) = book_of.worksheet_cells_reader(&name) else { continue };
        let mut rows = SheetRows::new(file, reader);
        let mut head: Vec<Vec<String>> = Vec::new();
        while head.len() < HEAD_ROWS && rows.advance()? {
            head.push(rows.row.iter().map(Value::text).collect());
        }
        if head.is_empty() {
            continue;
        }
        match Table::look(&head, b'.', options) {
            Ok(table) => found.push((name, table)),
            Err(problem) => problems.push(format!("sheet `{name}` is passed over: {problem}")),
        }
    }
    if found.is_empty() {
        let why = if problems.is_empty() { "its sheets are empty".to_owned() } else { problems.join("; ") };
        return Err(file.content(NAME, why));
    }
    let several = found.len() > 1;
    let mut layout = Layout::default();
    let mut sheets = Vec::new();
    for (name, mut table) in found {
        let (first_group, first_column) = (layout.groups.len(), layout.columns.len());
        for group in &table.layout.groups {
            let mut group = group.clone();
            group.name = match (several, group.name.is_empty()) {
                (false, _) => group.name,
                (true, true) => name.clone(),
                (true, false) => format!("{name}: {}", group.name),
            };
            layout.groups.push(group);
        }
        layout.columns.extend(table.layout.columns.iter().cloned().map(|mut column| {
            column.group += first_group;
            column
        }));
        layout.findings.extend(table.layout.findings.drain(..).map(|finding| format!("sheet `{name}`: {finding}")));
        layout.start_time_ns = layout.start_time_ns.or(table.layout.start_time_ns);
        sheets.push(Sheet { name, table, first_group, first_column });
    }
    layout.findings.append(&mut problems);
    Ok(Box::new(Workbook { file: file.clone(), layout, sheets }))
}

impl Log for Workbook {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let mut book = book(&self.file)?;
        for sheet in &self.sheets {
            let columns = sheet.first_column..sheet.first_column + sheet.table.layout.columns.len();
            let own: Vec<usize> = wanted.iter().filter(|column| columns.contains(*column)).map(|column| column - sheet.first_column).collect();
            if own.is_empty() {
                continue;
            }
            let reader = book.worksheet_cells_reader(&sheet.name).map_err(failed(&self.file))?;
            let mut of_book = |row: Row<'_>| sink(Row { group: row.group + sheet.first_group, ..row });
            sheet.table.rows(&mut SheetRows::new(&self.file, reader), &own, &mut of_book)?;
        }
        Ok(())
    }
}

/// What a cell holds.
#[derive(Debug, Clone, PartialEq)]
enum Value {
    Empty,
    Number(f64),
    Text(String),
    Instant(Instant),
}

impl Value {
    fn of(data: &DataRef<'_>) -> Value {
        match data {
            DataRef::DateTime(date) => instant_of(date.as_f64()).map_or(Value::Empty, Value::Instant),
            DataRef::String(text) | DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => Value::Text(text.trim().to_owned()),
            DataRef::SharedString(text) => Value::Text(text.trim().to_owned()),
            data => data.as_f64().filter(|value| value.is_finite()).map_or(Value::Empty, Value::Number),
        }
    }

    fn is_empty(&self) -> bool {
        match self {
            Value::Empty => true,
            Value::Text(text) => text.is_empty(),
            _ => false,
        }
    }

    fn text(&self) -> String {
        match self {
            Value::Empty => String::new(),
            Value::Number(value) => value.to_string(),
            Value::Text(text) => text.clone(),
            Value::Instant(instant) => text_of(*instant).unwrap_or_default(),
        }
    }
}

/// Excel's days since its origin; below one a time of day.
fn instant_of(days: f64) -> Option<Instant> {
    if !(0.0..LAST_DAY).contains(&days) {
        return None;
    }
    // To the microsecond: the days of now hold no more.
    let ns_of_day = ((days.fract() * NS_PER_DAY as f64) / 1e3).round() as i64 * 1000;
    let day = (days >= 1.0).then_some(days.trunc() as i64 - EXCEL_EPOCH_DAYS);
    Some(Instant { day, ns_of_day: Some(ns_of_day) })
}

fn text_of(instant: Instant) -> Option<String> {
    let ns = instant.ns_of_day?.rem_euclid(NS_PER_DAY);
    let second = ns / 1_000_000_000;
    let (hour, minute) = (i8::try_from(second / 3600).ok()?, i8::try_from(second / 60 % 60).ok()?);
    let time = Time::new(hour, minute, i8::try_from(second % 60).ok()?, i32::try_from(ns % 1_000_000_000).ok()?).ok()?;
    let Some(day) = instant.day else { return Some(time.to_string()) };
    let date = Date::new(1970, 1, 1).ok()?.checked_add(day.days()).ok()?;
    Some(format!("{date} {time}"))
}

/// The rows of a sheet; those without any cell do not count.
struct SheetRows<'a> {
    file: LogFile,
    reader: XlsxCellReader<'a, Box<dyn ReadSeek>>,
    /// The first cell of the next row.
    next: Option<(u32, usize, Value)>,
    /// Whether the last cell was read: behind it the reader complains.
    ended: bool,
    row: Vec<Value>,
}

impl<'a> SheetRows<'a> {
    fn new(file: &LogFile, reader: XlsxCellReader<'a, Box<dyn ReadSeek>>) -> Self {
        SheetRows { file: file.clone(), reader, next: None, ended: false, row: Vec::new() }
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
            (row, usize::try_from(column).unwrap_or(usize::MAX), Value::of(cell.get_value()))
        }))
    }
}

impl Cells for SheetRows<'_> {
    fn number(&self, column: usize) -> f64 {
        match self.row.get(column) {
            Some(Value::Number(value)) => *value,
            Some(Value::Text(text)) => parse_number(text.as_bytes(), b'.').unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }

    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant> {
        match self.row.get(column)? {
            Value::Instant(instant) => Some(*instant),
            Value::Text(text) => parse_instant(text, order),
            _ => None,
        }
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
