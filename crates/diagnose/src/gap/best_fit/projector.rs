//! Projects nuisances out of columns.

use crate::gap::best_fit::normal::{normal_matrix, nuisance_products};
use crate::gap::best_fit::selection::{Selection, dot_over};
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::{Linearised, dot};
use nalgebra::{Cholesky, DVector, Dyn};
use std::ops::Range;

/// Products of the rows of a step of a column: with the free columns, with themselves, with the residual.
pub(crate) struct Share {
    pub(crate) right: DVector<f64>,
    pub(crate) own: f64,
    pub(crate) seen: f64,
}

/// Repeated solver for the nuisance block of the normal equations.
pub(crate) struct Projector<'a> {
    linearised: &'a Linearised,
    rows: Vec<Range<usize>>,
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
        self.projected(dot_over(&self.rows, a, b), right_a, right_b)
    }

    /// The same where the product with the free columns in is known.
    pub(crate) fn projected(&self, product: f64, right_a: &DVector<f64>, right_b: &DVector<f64>) -> f64 {
        product - right_a.dot(&self.cholesky.solve(right_b))
    }

    /// [`Projector::right`] of some rows alone, and their product with another column and with themselves.
    pub(crate) fn share(&self, rows: &Range<usize>, column: &[f64], residual: &[f64]) -> Share {
        let own = &column[rows.clone()];
        let columns = self.linearised.columns.iter().chain(self.others);
        let right = columns.map(|other| dot(&other[rows.clone()], own));
        Share {
            right: DVector::from_iterator(self.linearised.columns.len() + self.others.len(), right),
            own: dot(own, own),
            seen: dot(own, &residual[rows.clone()]),
        }
    }
}
