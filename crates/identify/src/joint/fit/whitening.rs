//! Whitens the rows of a step by the Cholesky factor of their covariance.

use nalgebra::DMatrix;

/// Cholesky factor of the covariance of a step's rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Whitening {
    lower: DMatrix<f64>,
    /// Half the ln of the determinant.
    pub(crate) ln_spread: f64,
}

impl Whitening {
    /// `None` if the covariance is not positive definite.
    pub(crate) fn new(covariance: DMatrix<f64>) -> Option<Self> {
        let lower = covariance.cholesky()?.unpack();
        let ln_spread = lower.diagonal().iter().map(|x| x.ln()).sum();
        Some(Whitening { lower, ln_spread })
    }

    /// Whitens columns in place.
    pub(crate) fn apply(&self, columns: &mut DMatrix<f64>) {
        // A Cholesky factor has no 0 on its diagonal.
        self.lower.solve_lower_triangular_mut(columns);
    }
}
