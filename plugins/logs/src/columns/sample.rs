//! The first rows of a table, from which its clocks are found.

use crate::columns::table_head::HeadColumn;
use crate::tables::table_row::{Cell, Cells};
use mapper_table::read_number;

/// Maximum number of rows of a table in its sample.
pub(crate) const HEAD_ROWS: usize = 400;

/// The first rows of data.
pub(crate) struct Sample<'a> {
    pub(crate) columns: &'a [HeadColumn],
    pub(crate) rows: &'a [Vec<String>],
    pub(crate) decimal: u8,
}

/// A row of the sample.
pub(crate) struct SampleRow<'a> {
    cells: &'a [String],
    decimal: u8,
}

impl Sample<'_> {
    pub(crate) fn rows(&self) -> impl Iterator<Item = SampleRow<'_>> {
        self.rows.iter().map(|cells| SampleRow { cells, decimal: self.decimal })
    }
}

impl Cells for SampleRow<'_> {
    fn cell(&self, column: usize) -> Cell<'_> {
        self.cells.get(column).map_or(Cell::Empty, |text| Cell::Text(text.as_bytes()))
    }

    fn decimal(&self) -> u8 {
        self.decimal
    }

    // The units in cells are not known yet.
    fn number(&self, column: usize) -> f64 {
        self.cells.get(column).and_then(|cell| read_number(cell, self.decimal)).unwrap_or(f64::NAN)
    }
}

/// The cells of a column that are not empty.
pub(crate) fn cells<'a>(column: usize, sample: &'a Sample<'_>) -> impl Iterator<Item = &'a str> {
    sample
        .rows
        .iter()
        .filter_map(move |row| row.get(column))
        .map(String::as_str)
        .filter(|cell| !cell.is_empty())
}
