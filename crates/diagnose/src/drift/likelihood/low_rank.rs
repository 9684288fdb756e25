//! Noise that is independent between segments, plus constants with priors: covariance D + U U'.

use crate::drift::runs::request::Unsolvable;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Noise with covariance D + U U'.
#[derive(Debug, Clone)]
pub(crate) struct LowRank {
    /// Lower Cholesky factor of each segment's own covariance.
    factors: Vec<DMatrix<f64>>,
    /// U, whitened by D: one column for each constant, scaled by its standard deviation.
    columns: DMatrix<f64>,
    /// I + U'U.
    inner: Cholesky<f64, Dyn>,
}

impl LowRank {
    /// `own` are the covariances of the segments, `columns` the effects of the constants on the readings.
    pub fn new(own: &[DMatrix<f64>], columns: &DMatrix<f64>) -> Result<Self, Unsolvable> {
        let factors = own
            .iter()
            .map(|covariance| Some(Cholesky::new(covariance.clone())?.l()))
            .collect::<Option<Vec<_>>>()
            .ok_or(Unsolvable::NoNoise)?;
        let mut whitened = columns.clone();
        whiten_by(&factors, &mut whitened);
        if whitened.iter().any(|value| !value.is_finite()) {
            return Err(Unsolvable::NotFinite);
        }
        let inner = DMatrix::identity(whitened.ncols(), whitened.ncols()) + whitened.transpose() * &whitened;
        let inner = Cholesky::new(inner).ok_or(Unsolvable::Dependent)?;
        Ok(LowRank { factors, columns: whitened, inner })
    }

    /// Whitens by D alone, column by column.
    pub fn whiten(&self, mut values: DMatrix<f64>) -> DMatrix<f64> {
        whiten_by(&self.factors, &mut values);
        values
    }

    /// Inverse covariance (whitened) times whitened columns.
    pub fn inverse_times(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        whitened - &self.columns * self.constants(whitened)
    }

    /// Most probable constants, in standard deviations, for whitened readings.
    pub fn constants(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        self.inner.solve(&(self.columns.transpose() * whitened))
    }

    /// Posterior variance of a linear function of the constants.
    pub fn variance(&self, weights: &DVector<f64>) -> f64 {
        weights.dot(&self.inner.solve(weights))
    }

    /// Degrees of freedom used by the constants: the trace of the projection onto them.
    pub fn degrees_of_freedom(&self) -> f64 {
        self.columns.ncols() as f64 - self.inner.inverse().trace()
    }
}

fn whiten_by(factors: &[DMatrix<f64>], values: &mut DMatrix<f64>) {
    let mut row = 0;
    for factor in factors {
        let size = factor.nrows();
        let mut part = values.rows_mut(row, size);
        // The factor of a positive definite matrix has no zero on its diagonal.
        let _ = factor.solve_lower_triangular_mut(&mut part);
        row += size;
    }
}
