//! Excel workbooks, with a table on each sheet.

use crate::clock::HEAD_ROWS;
use crate::tables::long_table::{Part, join_tables};
use crate::tables::table_log::{Origin, Table};
use crate::tables::table_row::{Cell, Cells, Rows};
use mapper_recording::logs::limits::{max_memory_bytes, max_unpacked_bytes};
use mapper_recording::logs::{
    Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, ReadSeek, Row, RowSink,
};
use mapper_table::{Book, SheetRows, Value, XLS_MAGIC, XlsxLimits, decimal_sign_of_cells};

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: None };

const NAME: &str = "Excel";

/// Maximum size of the text in the sample, bytes.
const HEAD_BYTES: usize = 1 << 24;

/// A zip file with the parts of a workbook, or a compound file; their contents are checked when it is opened.
fn recognises(head: &[u8]) -> bool {
    let holds = |part: &[u8]| head.windows(part.len()).any(|window| window == part);
    head.starts_with(&XLS_MAGIC)
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

fn open_book(file: &LogFile) -> Result<Book<Box<dyn ReadSeek>>, LogError> {
    let size_bytes = file.size_bytes()?;
    let limits = XlsxLimits {
        unpacked_bytes: max_unpacked_bytes(size_bytes),
        memory_bytes: max_memory_bytes(size_bytes),
    };
    Book::open(file.open()?, limits).map_err(|why| file.content_error(NAME, why))
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options
        .refuse_keys(&["separator", "decimal", "encoding"])
        .map_err(|why| file.content_error(NAME, why))?;
    let mut book = open_book(file)?;
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
            let Some(rows) = book.rows(name) else { continue };
            match head_of(BookRows { file, rows, decimal: b'.' }, options)? {
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

fn head_of(mut rows: BookRows<'_>, options: &LogOptions) -> Result<SheetHead, LogError> {
    let mut cells: Vec<Vec<Value>> = Vec::new();
    let mut bytes = 0;
    while cells.len() < HEAD_ROWS && bytes < HEAD_BYTES && rows.advance()? {
        bytes += rows.rows.row().iter().map(Value::size).sum::<usize>();
        cells.push(rows.rows.row().to_vec());
    }
    if cells.is_empty() {
        return Ok(None);
    }
    let decimal = decimal_sign_of_cells(&cells);
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
        let mut book = open_book(&self.file)?;
        for (sheet, decimal) in self.sheets.iter().zip(&self.decimals) {
            let own = sheet.own(wanted);
            if own.is_empty() {
                continue;
            }
            let Some(rows) = book.rows(&sheet.name) else { continue };
            let mut of_book = |row: Row<'_>| sheet.forward_row(row, sink);
            let mut rows = BookRows { file: &self.file, rows, decimal: *decimal };
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

struct BookRows<'a> {
    file: &'a LogFile,
    rows: SheetRows<'a>,
    decimal: u8,
}

impl Cells for BookRows<'_> {
    fn cell(&self, column: usize) -> Cell<'_> {
        match self.rows.row().get(column) {
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

impl Rows for BookRows<'_> {
    fn advance(&mut self) -> Result<bool, LogError> {
        self.rows.advance().map_err(|why| self.file.content_error(NAME, why))
    }
}
