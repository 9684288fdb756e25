//! Findings while they are collected.

use crate::mistakes::finding::{Finding, SHOWN_LIMIT};

/// Findings during the checks. Their number is limited, so that a hostile file cannot exhaust the memory.
#[derive(Debug, Default)]
pub struct Notes {
    list: Vec<Finding>,
    overflow: usize,
}

impl Notes {
    /// Ten times the number shown, so that those shown are the first ones of the file after sorting.
    const LIMIT: usize = 10 * SHOWN_LIMIT;

    /// Adds a finding.
    pub fn push(&mut self, finding: Finding) {
        self.push_with(|| finding);
    }

    /// Creates and adds a finding if the limit is not reached: locating it in a long line takes time.
    pub fn push_with(&mut self, finding: impl FnOnce() -> Finding) {
        if self.list.len() < Self::LIMIT {
            self.list.push(finding());
        } else {
            self.overflow += 1;
        }
    }

    /// Whether the limit was exceeded; further checks are then unnecessary.
    pub fn is_full(&self) -> bool {
        self.overflow > 0
    }

    /// Whether there are no findings.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The findings, in the order of the checks.
    pub fn list(&self) -> &[Finding] {
        &self.list
    }

    pub(crate) fn into_parts(self) -> (Vec<Finding>, usize) {
        (self.list, self.overflow)
    }
}
