//! Misfit that a fit cannot absorb.

use crate::gap::residuals::whiten::dot;
use nalgebra::{DMatrix, DVector};

/// Squared residual of `difference` (whitened) after fitting `columns`; `precision` is the prior precision of their coefficients. `None` if
/// the equations are singular.
pub(crate) fn misfit(difference: &[f64], columns: &[Vec<f64>], precision: &DMatrix<f64>) -> Option<f64> {
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
    let taken = right.dot(&matrix.cholesky()?.solve(&right));
    Some((dot(difference, difference) - taken).max(0.0))
}
