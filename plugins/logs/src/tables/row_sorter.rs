//! Rows out of order, sorted by time while they are read.

use std::collections::VecDeque;

/// How many rows are held back: a row that comes later than this many others stays out of order. Loggers that send their rows in
/// packets mix up some dozens; this many rows of a hundred columns take 6 MB.
const HELD_BACK: usize = 8192;

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct RowSorter {
    /// By time, the earliest first.
    rows: VecDeque<(f64, Vec<f64>)>,
}

impl RowSorter {
    /// Takes a row, and returns the earliest one if enough are held back.
    pub(crate) fn exchange(&mut self, t_s: f64, values: &[f64]) -> Option<(f64, Vec<f64>)> {
        let at = self.rows.partition_point(|(other_s, _)| *other_s <= t_s);
        self.rows.insert(at, (t_s, values.to_vec()));
        if self.rows.len() > HELD_BACK { self.rows.pop_front() } else { None }
    }

    /// The rows held back.
    pub(crate) fn rest(self) -> impl Iterator<Item = (f64, Vec<f64>)> {
        self.rows.into_iter()
    }
}
