//! Closed-form evidence of a few linear terms.

use nalgebra::{DMatrix, DVector};

/// Fit of some terms to the projected products: log evidence relative to none, and the coefficients in steps.
#[derive(Debug, Clone)]
pub struct LinearEvidence {
    /// Log evidence relative to no term.
    pub gain: f64,
    /// Coefficients, steps.
    pub coefficients: DVector<f64>,
}

/// Evidence of the terms at `places` of the projected products, whose last row and column belong to the residual; `prior_sigma` in steps.
pub fn linear_evidence(
    products: &DMatrix<f64>,
    places: &[usize],
    prior_sigma: f64,
) -> Option<LinearEvidence> {
    let last = products.nrows() - 1;
    let k = places.len();
    let mut matrix = DMatrix::from_fn(k, k, |i, j| products[(places[i], places[j])]);
    let right = DVector::from_fn(k, |i, _| products[(places[i], last)]);
    for i in 0..k {
        matrix[(i, i)] += prior_sigma.powi(-2);
    }
    let cholesky = matrix.cholesky()?;
    let coefficients = cholesky.solve(&right);
    let half_ln_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    let gain = 0.5 * right.dot(&coefficients) - half_ln_determinant - k as f64 * prior_sigma.ln();
    Some(LinearEvidence { gain, coefficients })
}

/// Evidence for coefficients with the common prior covariance `scale^2 shape`.
pub fn weigh_process(
    products: &DMatrix<f64>,
    right: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Option<Posterior> {
    let k = right.len();
    // With K = R R', I + R' G R is well conditioned for any K.
    let mut jittered = covariance.clone();
    for i in 0..k {
        jittered[(i, i)] *= 1.0 + 1e-9;
    }
    let root = jittered.cholesky()?.l();
    let mut inner = root.tr_mul(&(products * &root));
    for i in 0..k {
        inner[(i, i)] += 1.0;
    }
    let cholesky = inner.cholesky()?;
    let asked = root.tr_mul(right);
    let answer = cholesky.solve(&asked);
    let half_ln_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    let gain = 0.5 * asked.dot(&answer) - half_ln_determinant;
    let mean = &root * answer;
    let covariance = &root * cholesky.solve(&root.transpose());
    Some(Posterior { gain, mean, covariance })
}

/// Posterior of a Gaussian process.
#[derive(Debug, Clone)]
pub struct Posterior {
    /// Log evidence relative to no process.
    pub gain: f64,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}
