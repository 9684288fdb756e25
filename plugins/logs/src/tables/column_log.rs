//! A log whose columns are in memory, in one or several tables.

use crate::columns::counter::HEAD_ROWS;
use crate::tables::column_rows::{Chunk, Chunks, ColumnRows};
use crate::tables::joined_tables::{Part, join_tables};
use crate::tables::table_log::{Origin, Table};
use mapper_recording::logs::limits::MAX_UNPACKED_BYTES;
use mapper_recording::logs::{Layout, Log, LogError, LogFile, LogFinding, LogOptions, Row, RowSink};

/// Columns of equal length.
pub(crate) struct ColumnTable {
    /// Title in messages.
    pub(crate) title: String,
    /// Names, and units if any is known.
    pub(crate) head: Vec<Vec<String>>,
    pub(crate) rows: usize,
    pub(crate) columns: Vec<Chunk>,
    /// The column that the file marks as independent.
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
///
/// # Errors
/// [`LogError`] if no table has a clock.
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

/// All rows at once.
struct Once(Option<(usize, Vec<Chunk>)>);

impl Chunks for Once {
    fn next_chunk(&mut self) -> Result<Option<(usize, Vec<Chunk>)>, LogError> {
        Ok(self.0.take())
    }
}
