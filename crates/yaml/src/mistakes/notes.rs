//! Findings while they are collected.

use crate::mistakes::finding::{Finding, SHOWN_LIMIT};

/// Findings during the checks. Their number is limited, so that a hostile file cannot exhaust the memory.
#[derive(Debug, Default)]
pub struct Notes {
    list: Vec<Finding>,
    overflow: usize,
}

impl Notes {
    /// Ten times what is shown, so that sorting by position shows the first ones of the file.
    const LIMIT: usize = 10 * SHOWN_LIMIT;

    /// Adds one.
    pub fn push(&mut self, finding: Finding) {
        self.push_with(|| finding);
    }

    /// Makes the finding only if it is kept: placing it in a long line takes time.
    pub fn push_with(&mut self, finding: impl FnOnce() -> Finding) {
        if self.list.len() < Self::LIMIT {
            self.list.push(finding());
        } else {
            self.overflow += 1;
        }
    }

    /// Whether there were more than are kept; then further checks are skipped too.
    pub fn is_full(&self) -> bool {
        self.overflow > 0
    }

    /// Whether nothing was found wrong.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Those kept so far, in the order in which they were found.
    pub fn list(&self) -> &[Finding] {
        &self.list
    }

    pub(crate) fn into_parts(self) -> (Vec<Finding>, usize) {
        (self.list, self.overflow)
    }
}
