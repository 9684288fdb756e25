//! Least squares that single bad points do not pull: Cauchy's weights, found again and again.

use mapper_numerics::statistics::{median, robust_sigma};
use nalgebra::{DMatrix, DVector};

/// Rounds of weighting: the weights hardly change after ten.
const ROUNDS: usize = 15;
/// Residual in robust standard deviations at which a point counts half.
const HALF_SIGMAS: f64 = 2.5;

/// A coefficient and its standard error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coefficient {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

/// Standard errors of a change over the run, at least: what the trend lacks (heat that the two-parameter method does not know) is no
/// noise, and makes six.
const CREEP_SIGMAS: f64 = 8.0;
/// Standard error of a change over the run above which time is not told from what else changed with it, as in a campaign that
/// goes from slow to fast: K.
const TOLD_APART_K: f64 = 1.2;

impl Coefficient {
    /// Whether a change over the run, K, is beyond `limit_k`, and neither noise nor another name for what was commanded.
    pub(crate) fn over(&self, limit_k: f64) -> bool {
        self.error < TOLD_APART_K && self.value.abs() > limit_k.max(CREEP_SIGMAS * self.error)
    }
}

/// Coefficients of `columns` (each as long as `values`) for `values`; `None` where they cannot be told apart.
pub(crate) fn fit(columns: &[Vec<f64>], values: &[f64]) -> Option<Vec<Coefficient>> {
    let (rows, count) = (values.len(), columns.len());
    if rows < count + 3 || columns.iter().flatten().chain(values).any(|value| !value.is_finite()) {
        return None;
    }
    let matrix = DMatrix::from_fn(rows, count, |i, j| columns[j][i]);
    let values = DVector::from_column_slice(values);
    let mut weights = DVector::from_element(rows, 1.0);
    let mut found = None;
    for _ in 0..ROUNDS {
        let weighted = DMatrix::from_fn(rows, count, |i, j| weights[i] * matrix[(i, j)]);
        let normal = (weighted.transpose() * &weighted).cholesky()?;
        let solved = normal.solve(&(weighted.transpose() * values.component_mul(&weights)));
        let residual = &values - &matrix * &solved;
        let level = median(values.iter().map(|value| value.abs())).unwrap_or(0.0);
        let sigma = robust_sigma(residual.as_slice())?.max(1e-9 * level);
        let inverse = normal.inverse();
        let errors = (0..count).map(|j| sigma * inverse[(j, j)].max(0.0).sqrt());
        found = Some(
            solved.iter().zip(errors).map(|(value, error)| Coefficient { value: *value, error }).collect(),
        );
        weights = residual.map(|residual| (1.0 + (residual / (HALF_SIGMAS * sigma)).powi(2)).sqrt().recip());
    }
    found
}
