//! Selection of the steps of a recording.

use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::{dot, rows_of_step};
use std::ops::Range;

/// Selected steps.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Whether each step is selected.
    pub steps: Vec<bool>,
}

impl Selection {
    /// All steps.
    pub fn all(study: &Study) -> Selection {
        Selection { steps: vec![true; study.steps.len()] }
    }

    /// Rows of the selected steps.
    pub fn rows(&self, study: &Study) -> Vec<Range<usize>> {
        let counts = |step: &usize| self.steps.get(*step).copied().unwrap_or(false);
        (0..study.steps.len()).filter(counts).map(|step| rows_of_step(study, step)).collect()
    }
}

/// Scalar product over some rows.
pub fn dot_over(rows: &[Range<usize>], a: &[f64], b: &[f64]) -> f64 {
    rows.iter().map(|range| dot(&a[range.clone()], &b[range.clone()])).sum()
}
