//! A log whose columns are in memory, in one or several tables, and its rows.

use crate::clock::HEAD_ROWS;
use crate::tables::long_table::{Part, join_tables};
use crate::tables::table_log::{Origin, Table};
use crate::tables::table_row::{Cell, Cells, Rows};
use mapper_recording::logs::limits::MAX_UNPACKED_BYTES;
use mapper_recording::logs::{Layout, Log, LogError, LogFile, LogFinding, LogOptions, Row, RowSink};
use mapper_table::{Instant, Value};

/// Some rows of a column; those after its end are empty.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(not(feature = "parquet"), allow(dead_code, reason = "MATLAB data have numbers only"))]
pub(crate) enum Chunk {
    Numbers(Vec<f64>),
    Instants(Vec<Option<Instant>>),
    Texts(Vec<String>),
}

impl Chunk {
    pub(crate) fn len(&self) -> usize {
        match self {
            Chunk::Numbers(values) => values.len(),
            Chunk::Instants(values) => values.len(),
            Chunk::Texts(values) => values.len(),
        }
    }

    fn value(&self, row: usize) -> Value {
        let found = match self {
            Chunk::Numbers(values) => {
                values.get(row).filter(|value| value.is_finite()).map(|value| Value::Number(*value))
            }
            Chunk::Instants(values) => values.get(row).copied().flatten().map(Value::Instant),
            Chunk::Texts(values) => values.get(row).map(|text| Value::Text(text.trim().to_owned())),
        };
        found.unwrap_or(Value::Empty)
    }
}

/// A source of columns, some rows at a time.
pub(crate) trait Chunks {
    fn next_chunk(&mut self) -> Result<Option<(usize, Vec<Chunk>)>, LogError>;
}

/// Rows of a table that is stored by columns: the header rows as text, then the data.
pub(crate) struct ColumnRows<C> {
    chunks: C,
    head: Vec<Vec<String>>,
    /// Header rows returned so far, including the present one.
    head_at: usize,
    chunk: Vec<Chunk>,
    count: usize,
    /// The current row of the chunk, from 1; 0 before the first row.
    at: usize,
}

impl<C: Chunks> ColumnRows<C> {
    /// `head`: names above the columns, and units if any is known.
    pub(crate) fn new(head: Vec<Vec<String>>, chunks: C) -> Self {
        ColumnRows { chunks, head, head_at: 0, chunk: Vec::new(), count: 0, at: 0 }
    }

    pub(crate) fn texts(&mut self, rows: usize) -> Result<Vec<Vec<String>>, LogError> {
        let mut found = Vec::new();
        while found.len() < rows && self.advance()? {
            found.push(match self.head_row() {
                Some(head) => head.clone(),
                None => self.chunk.iter().map(|chunk| chunk.value(self.at - 1).text(b'.')).collect(),
            });
        }
        Ok(found)
    }

    fn head_row(&self) -> Option<&Vec<String>> {
        if self.at > 0 { None } else { self.head.get(self.head_at.checked_sub(1)?) }
    }
}

impl<C: Chunks> Cells for ColumnRows<C> {
    fn cell(&self, column: usize) -> Cell<'_> {
        let row = self.at.wrapping_sub(1);
        let cell = self.chunk.get(column).and_then(|chunk| match chunk {
            Chunk::Numbers(values) => values.get(row).map(|value| Cell::Number(*value)),
            Chunk::Texts(values) => values.get(row).map(|text| Cell::Text(text.trim().as_bytes())),
            Chunk::Instants(values) => values.get(row).copied().flatten().map(Cell::Instant),
        });
        cell.unwrap_or(Cell::Empty)
    }
}

impl<C: Chunks> Rows for ColumnRows<C> {
    fn advance(&mut self) -> Result<bool, LogError> {
        if self.at == 0 && self.head_at < self.head.len() {
            self.head_at += 1;
            return Ok(true);
        }
        while self.at >= self.count {
            let Some((count, chunk)) = self.chunks.next_chunk()? else { return Ok(false) };
            (self.count, self.chunk, self.at) = (count, chunk, 0);
        }
        self.at += 1;
        Ok(true)
    }
}

pub(crate) struct ColumnTable {
    pub(crate) title: String,
    pub(crate) head: Vec<Vec<String>>,
    pub(crate) rows: usize,
    pub(crate) columns: Vec<Chunk>,
    pub(crate) clock: Option<String>,
}

impl ColumnTable {
    fn rows(&self) -> ColumnRows<Once> {
        ColumnRows::new(self.head.clone(), Once(Some((self.rows, self.columns.clone()))))
    }
}

/// Options of formats whose files name their columns.
pub(crate) const COLUMN_OPTIONS: [&str; 5] = ["time", "time_unit", "date_order", "rate", "missing"];

/// Refuses options that do not apply to columns, and a file that does not fit into memory.
pub(crate) fn check_columns_file(
    file: &LogFile,
    name: &'static str,
    options: &LogOptions,
) -> Result<(), LogError> {
    options.allow_only(&COLUMN_OPTIONS).map_err(|why| file.content_error(name, why))?;
    if file.size_bytes()? > MAX_UNPACKED_BYTES {
        let message = format!("it has more than {} MiB; export it in parts", MAX_UNPACKED_BYTES >> 20);
        return Err(file.content_error(name, message));
    }
    Ok(())
}

struct ColumnLog {
    layout: Layout,
    parts: Vec<Part>,
    tables: Vec<ColumnTable>,
}

/// The log of tables. `word` is the format's term for a table; `problems` lists unread parts of the file.
pub(crate) fn column_log(
    file: &LogFile,
    (name, word): (&'static str, &str),
    tables: Vec<ColumnTable>,
    mut problems: Vec<LogFinding>,
    options: &LogOptions,
) -> Result<Box<dyn Log>, LogError> {
    let (mut analysed, mut readable) = (Vec::new(), Vec::new());
    for table in tables {
        let head = table.rows().texts(HEAD_ROWS)?;
        let own = LogOptions { time: table.clock.iter().cloned().collect(), ..options.clone() };
        let options = if options.time.is_empty() { &own } else { options };
        match Table::analyse(&head, b'.', options, Origin::Columns) {
            Ok(analysis) => {
                analysed.push((table.title.clone(), analysis));
                readable.push(table);
            }
            Err(problem) => problems.push(LogFinding::skipped(word, &table.title, problem)),
        }
    }
    let (layout, parts) =
        join_tables(word, analysed, problems).map_err(|why| file.content_error(name, why))?;
    Ok(Box::new(ColumnLog { layout, parts, tables: readable }))
}

impl Log for ColumnLog {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        for (part, table) in self.parts.iter().zip(&self.tables) {
            let own = part.own(wanted);
            if own.is_empty() {
                continue;
            }
            let mut of_file = |row: Row<'_>| part.forward_row(row, sink);
            self.layout.add_finding(part.table.rows(&mut table.rows(), &own, &mut of_file)?);
        }
        Ok(())
    }
}

struct Once(Option<(usize, Vec<Chunk>)>);

impl Chunks for Once {
    fn next_chunk(&mut self) -> Result<Option<(usize, Vec<Chunk>)>, LogError> {
        Ok(self.0.take())
    }
}
