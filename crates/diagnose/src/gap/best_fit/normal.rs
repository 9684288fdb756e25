//! Normal equations of nuisances and effects over selected steps, and the projection of nuisances out of columns.

use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::{Linearised, dot, rows_of_step};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;

/// Prior width of an effect's parameter, in typical steps. Bound: a step is clearly visible, and a part that differs by ten is broken.
pub(crate) const PRIOR_STEPS: f64 = 10.0;
/// Precision of a parameter without influence. Bound: keeps the equations solvable.
const MIN_PRECISION: f64 = 1e-6;

pub(crate) fn nuisance_products(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
) -> DMatrix<f64> {
    let n = study.nuisances.len();
    let counted = linearised.products.iter().zip(&selection.steps).filter(|(_, counts)| **counts);
    counted.fold(DMatrix::zeros(n, n), |sum, (products, _)| sum + products)
}

/// Precision of the nuisances, including their unit priors, and of additional columns.
pub(crate) fn normal_matrix(
    rows: &[Range<usize>],
    linearised: &Linearised,
    nuisance_products: &DMatrix<f64>,
    others: &[Vec<f64>],
) -> DMatrix<f64> {
    let (n, k) = (nuisance_products.nrows(), others.len());
    let mut matrix = DMatrix::zeros(n + k, n + k);
    matrix.view_mut((0, 0), (n, n)).copy_from(nuisance_products);
    for i in 0..n {
        matrix[(i, i)] += 1.0;
    }
    for (j, other) in others.iter().enumerate() {
        for i in 0..n {
            let product = dot_over(rows, &linearised.columns[i], other);
            matrix[(i, n + j)] = product;
            matrix[(n + j, i)] = product;
        }
        for (l, third) in others.iter().enumerate().take(j + 1) {
            let product = dot_over(rows, third, other);
            matrix[(n + l, n + j)] = product;
            matrix[(n + j, n + l)] = product;
        }
        matrix[(n + j, n + j)] += MIN_PRECISION;
    }
    matrix
}

/// Squared residual of whitened `difference` after fitting `columns` with prior `precision`; `None` if the equations are singular.
fn misfit(difference: &[f64], columns: &[Vec<f64>], precision: &DMatrix<f64>) -> Option<f64> {
    let n = columns.len();
    let mut matrix = precision.clone();
    for i in 0..n {
        for j in 0..=i {
            let product = dot(&columns[i], &columns[j]);
            matrix[(i, j)] += product;
            if i != j {
                matrix[(j, i)] += product;
            }
        }
    }
    let right = DVector::from_fn(n, |i, _| dot(&columns[i], difference));
    let explained = right.dot(&matrix.cholesky()?.solve(&right));
    Some((dot(difference, difference) - explained).max(0.0))
}

/// Prediction of a fit for an experiment, its derivatives, and the prior precision of the fit's parameters; all whitened.
pub(crate) type ExpectedFit = (Vec<f64>, Vec<Vec<f64>>, DMatrix<f64>);

/// Misfit of each fit (column) after a refit to an experiment, if another fit (row) is true, in squared sigmas.
pub(crate) fn misfit_increases(fits: &[ExpectedFit]) -> Option<Vec<Vec<f64>>> {
    let of_truth = |truth: &Vec<f64>| -> Option<Vec<f64>> {
        let of_rival = |(predicted, columns, precision): &ExpectedFit| {
            let difference: Vec<f64> = truth.iter().zip(predicted).map(|(a, b)| a - b).collect();
            misfit(&difference, columns, precision)
        };
        fits.iter().map(of_rival).collect()
    };
    fits.iter().map(|(truth, ..)| of_truth(truth)).collect()
}

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

#[derive(Debug, Clone)]
pub(crate) struct Selection {
    /// Whether each step is selected.
    pub steps: Vec<bool>,
}

impl Selection {
    pub(crate) fn all(study: &Study) -> Selection {
        Selection { steps: vec![true; study.steps.len()] }
    }

    pub(crate) fn rows(&self, study: &Study) -> Vec<Range<usize>> {
        let counts = |step: &usize| self.steps.get(*step).copied().unwrap_or(false);
        (0..study.steps.len()).filter(counts).map(|step| rows_of_step(study, step)).collect()
    }
}

pub(crate) fn dot_over(rows: &[Range<usize>], a: &[f64], b: &[f64]) -> f64 {
    rows.iter().map(|range| dot(&a[range.clone()], &b[range.clone()])).sum()
}
