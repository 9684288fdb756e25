//! One row of a table, independent of its storage.

use crate::notation::instant::Instant;
use mapper_recording::logs::{DateOrder, LogError};

/// The cells of a row.
pub(crate) trait Cells {
    /// The number in a cell; NaN without a number.
    fn number(&self, column: usize) -> f64;

    /// The number of a cell with this unit after it; NaN without a number, or with another unit.
    fn number_in(&self, column: usize, unit: &str) -> f64;

    /// The date or time of day in a cell.
    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant>;
}

/// Rows one after the other.
pub(crate) trait Rows: Cells {
    /// Advances to the next row; `false` after the last one.
    ///
    /// # Errors
    /// [`LogError`] if the file cannot be read further.
    fn advance(&mut self) -> Result<bool, LogError>;
}
