//! The first rows of a table, from which its clocks are found.

use crate::columns::table_head::HeadColumn;
use crate::notation::instant::{Instant, parse_instant};
use crate::notation::number::{number_in, read_number};
use crate::notation::table_row::Cells;
use mapper_recording::logs::DateOrder;

/// Maximum number of rows of a table in its sample.
pub(crate) const HEAD_ROWS: usize = 400;

/// The first rows of data.
pub(crate) struct Sample<'a> {
    pub(crate) columns: &'a [HeadColumn],
    pub(crate) rows: &'a [Vec<String>],
    pub(crate) decimal: u8,
}

pub(crate) struct SampleRow<'a>(pub(crate) &'a [String], pub(crate) u8);

impl Cells for SampleRow<'_> {
    fn number(&self, column: usize) -> f64 {
        self.0.get(column).and_then(|cell| read_number(cell, self.1)).unwrap_or(f64::NAN)
    }

    fn number_in(&self, column: usize, unit: &str) -> f64 {
        self.0.get(column).map_or(f64::NAN, |cell| number_in(cell, self.1, unit))
    }

    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant> {
        parse_instant(self.0.get(column)?, order)
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
