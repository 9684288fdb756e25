//! Sorts rows by time while they are read.

use std::collections::VecDeque;

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

    /// The buffered rows.
    pub(crate) fn rest(self) -> impl Iterator<Item = (f64, Vec<f64>)> {
        self.rows.into_iter()
    }
}
