//! Normal equations of nuisances and effects.

use crate::gap::best_fit::selection::{Selection, dot_over};
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::{Linearised, dot};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Prior width of an effect's parameter, in typical steps.
pub const PRIOR_STEPS: f64 = 10.0;

/// Products of the nuisance columns over the selected steps.
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
        // Keeps the equations solvable if a parameter has no influence.
        matrix[(n + j, n + j)] += 1e-6;
    }
    matrix
}

/// Squared residual of `difference` (whitened) after fitting `columns`; `precision` is the prior precision of their coefficients. `None` if
/// the equations are singular.
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
