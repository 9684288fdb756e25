//! One row of a table, independent of its storage.

use mapper_recording::logs::LogError;
use mapper_table::{DateOrder, Instant, NO_READING, number_in, parse_instant, parse_number};

/// The content of a cell.
pub(crate) enum Cell<'a> {
    Empty,
    Number(f64),
    /// Text in UTF-8, not necessarily valid.
    Text(&'a [u8]),
    Instant(Instant),
}

/// The cells of a row.
pub(crate) trait Cells {
    fn cell(&self, column: usize) -> Cell<'_>;

    /// Decimal sign of numbers in texts.
    fn decimal(&self) -> u8 {
        b'.'
    }

    /// The number in a cell; NaN without a number.
    fn number(&self, column: usize) -> f64 {
        match self.cell(column) {
            Cell::Number(value) if value.abs() < NO_READING => value,
            Cell::Text(text) => parse_number(text, self.decimal()).unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }

    /// The number of a cell with this unit after it, or of a cell with a number alone; else NaN.
    fn number_in(&self, column: usize, unit: &str) -> f64 {
        match self.cell(column) {
            Cell::Text(text) => number_in(&String::from_utf8_lossy(text), self.decimal(), unit),
            _ => self.number(column),
        }
    }

    /// The date or time of day in a cell.
    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant> {
        match self.cell(column) {
            Cell::Instant(instant) => Some(instant),
            Cell::Text(text) => parse_instant(&String::from_utf8_lossy(text), order),
            _ => None,
        }
    }
}

/// Rows one after the other.
pub(crate) trait Rows: Cells {
    /// Advances to the next row; `false` after the last one.
    ///
    /// # Errors
    /// [`LogError`] if the file cannot be read further.
    fn advance(&mut self) -> Result<bool, LogError>;
}
