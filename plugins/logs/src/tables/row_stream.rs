//! The lines of a delimited file as rows of a log.

use crate::tables::table_row::{Cell, Cells, Rows};
use mapper_recording::logs::{LogError, LogFile};
use mapper_table::{Dialect, TextRows};

/// The rows of a delimited file.
pub(crate) struct RowStream {
    file: LogFile,
    rows: TextRows,
    decimal: u8,
}

impl RowStream {
    pub(crate) fn open(file: &LogFile, dialect: Dialect) -> Result<Self, LogError> {
        let rows = TextRows::new(Box::new(file.open()?), dialect);
        Ok(RowStream { file: file.clone(), rows, decimal: dialect.decimal })
    }

    /// The cells of the row as text.
    pub(crate) fn texts(&self) -> Vec<String> {
        self.rows.texts()
    }
}

impl Cells for RowStream {
    fn cell(&self, column: usize) -> Cell<'_> {
        Cell::Text(self.rows.bytes(column))
    }

    fn decimal(&self) -> u8 {
        self.decimal
    }
}

impl Rows for RowStream {
    fn advance(&mut self) -> Result<bool, LogError> {
        self.rows.advance().map_err(|error| self.file.read_error(error))
    }
}
