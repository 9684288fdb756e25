//! One row of a table, independent of its storage; the lines of a delimited file as rows; rows sorted by time while they are read.

use mapper_recording::logs::{LogError, LogFile};
use mapper_table::{
    DateOrder, Dialect, Instant, NO_READING, TextRows, number_in, parse_instant, parse_number,
};
use std::collections::VecDeque;

pub(crate) enum Cell<'a> {
    Empty,
    Number(f64),
    /// Text in UTF-8, not necessarily valid.
    Text(&'a [u8]),
    Instant(Instant),
}

pub(crate) trait Cells {
    fn cell(&self, column: usize) -> Cell<'_>;

    fn decimal(&self) -> u8 {
        b'.'
    }

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

    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant> {
        match self.cell(column) {
            Cell::Instant(instant) => Some(instant),
            Cell::Text(text) => parse_instant(&String::from_utf8_lossy(text), order),
            _ => None,
        }
    }
}

pub(crate) trait Rows: Cells {
    /// Advances to the next row; `false` after the last one.
    fn advance(&mut self) -> Result<bool, LogError>;
}

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

/// Number of buffered rows: a row that is late by more rows stays out of order. Loggers that send packets mix up some dozens. The buffer
/// takes 6 MB for a hundred columns.
const BUFFERED_ROWS: usize = 8192;

/// A buffer that returns rows in order of time.
#[derive(Debug, Default)]
pub(crate) struct RowSorter {
    /// By time, the earliest first.
    rows: VecDeque<(f64, Vec<f64>)>,
}

impl RowSorter {
    /// Adds a row, and returns the earliest one if the buffer is full.
    pub(crate) fn exchange(&mut self, t_s: f64, values: &[f64]) -> Option<(f64, Vec<f64>)> {
        let at = self.rows.partition_point(|(other_s, _)| *other_s <= t_s);
        self.rows.insert(at, (t_s, values.to_vec()));
        if self.rows.len() > BUFFERED_ROWS { self.rows.pop_front() } else { None }
    }

    pub(crate) fn rest(self) -> impl Iterator<Item = (f64, Vec<f64>)> {
        self.rows.into_iter()
    }
}
