//! Projects nuisances out of columns.

use crate::gap::best_fit::normal::{normal_matrix, nuisance_products};
use crate::gap::best_fit::selection::{Selection, dot_over};
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use nalgebra::{Cholesky, DVector, Dyn};

/// Repeated solver for the nuisance block of the normal equations.
pub(crate) struct Projector<'a> {
    linearised: &'a Linearised,
    rows: Vec<std::ops::Range<usize>>,
    cholesky: Cholesky<f64, Dyn>,
    /// Additional free columns.
    others: &'a [Vec<f64>],
}

impl<'a> Projector<'a> {
    pub(crate) fn new(
        study: &Study,
        linearised: &'a Linearised,
        selection: &Selection,
        others: &'a [Vec<f64>],
    ) -> Option<Projector<'a>> {
        let rows = selection.rows(study);
        let products = nuisance_products(study, linearised, selection);
        let matrix = normal_matrix(&rows, linearised, &products, others);
        Some(Projector { linearised, rows, cholesky: matrix.cholesky()?, others })
    }

    pub(crate) fn right(&self, column: &[f64]) -> DVector<f64> {
        let n = self.linearised.columns.len();
        DVector::from_fn(n + self.others.len(), |i, _| {
            let other = if i < n { &self.linearised.columns[i] } else { &self.others[i - n] };
            dot_over(&self.rows, other, column)
        })
    }

    /// Product of two columns after projecting out the free ones (softened by their priors).
    pub(crate) fn product(
        &self,
        a: &[f64],
        right_a: &DVector<f64>,
        b: &[f64],
        right_b: &DVector<f64>,
    ) -> f64 {
        dot_over(&self.rows, a, b) - right_a.dot(&self.cholesky.solve(right_b))
    }
}
