//! Noise of the inputs, and the whitening of residuals.

use crate::joint::step_model::parameters::{
    ALPHA, EXPONENT, LN_CAPACITY, LN_COEFFICIENT, LN_HEATING_COOLING_RATIO, LN_INNER_CONDUCTANCE,
    LN_THIRD_CONDUCTANCE, LOGIT_AREA, LOGIT_INNER, LOGIT_THIRD, LOGIT_THIRD_AREA, PREHEAT, PROBE_MM2, Place,
    SHARED, SharedVector, TC_GAIN, TC_LAG,
};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Parameters on which the effect of input noise depends, with the step of the derivative. Bound: small against the change of the effect.
pub(crate) const BY_INPUT_NOISE: [(Place, f64); 15] = [
    (LN_COEFFICIENT, 1e-3),
    (EXPONENT, 1e-3),
    (ALPHA, 1e-3),
    (PROBE_MM2, 1e-2),
    (LN_HEATING_COOLING_RATIO, 1e-3),
    (PREHEAT, 1e-2),
    (TC_LAG, 1e-2),
    (TC_GAIN, 1e-3),
    (LN_CAPACITY, 1e-3),
    (LOGIT_INNER, 1e-2),
    (LN_INNER_CONDUCTANCE, 1e-2),
    (LOGIT_AREA, 1e-2),
    (LOGIT_THIRD, 1e-2),
    (LN_THIRD_CONDUCTANCE, 1e-2),
    (LOGIT_THIRD_AREA, 1e-2),
];

/// The expected sum of squares of input noise, about the shared parameters at which it was found: `slope d + d^T square d`.
#[derive(Debug, Clone)]
pub(crate) struct InputNoise {
    pub(crate) at: SharedVector,
    pub(crate) slope: SharedVector,
    /// One row and column for each of [`BY_INPUT_NOISE`].
    pub(crate) square: DMatrix<f64>,
}

impl InputNoise {
    /// That of inputs without noise.
    pub(crate) fn none() -> Self {
        let count = BY_INPUT_NOISE.len();
        InputNoise { at: [0.0; SHARED], slope: [0.0; SHARED], square: DMatrix::zeros(count, count) }
    }

    /// Change of the fitted parameters since it was found.
    pub(crate) fn change(&self, shared: &SharedVector, fitted: &[Place]) -> DVector<f64> {
        DVector::from_iterator(fitted.len(), fitted.iter().map(|index| shared[*index] - self.at[*index]))
    }

    /// Its change since it was found, by the slopes alone.
    pub(crate) fn value(&self, shared: &SharedVector) -> f64 {
        let terms = self.slope.iter().zip(shared.iter().zip(&self.at));
        terms.map(|(slope, (shared, at))| slope * (shared - at)).sum()
    }

    /// Half its second derivatives by the fitted parameters: what their noise adds to the apparent information.
    pub(crate) fn square_of(&self, fitted: &[Place]) -> DMatrix<f64> {
        let place = |index: usize| BY_INPUT_NOISE.iter().position(|(other, _)| *other == fitted[index]);
        DMatrix::from_fn(fitted.len(), fitted.len(), |a, b| {
            place(a).zip(place(b)).map_or(0.0, |pair| self.square[pair])
        })
    }
}

/// Rows of the inverse that are kept together. Bound: large enough for a fast product, small against a step's rows.
const PANEL_ROWS: usize = 32;

/// Inverse of the Cholesky factor of the covariance of a step's rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Whitening {
    /// Many blocks of columns are whitened by one factor, and a product takes a tenth of the time of a solution. Of every [`PANEL_ROWS`] rows:
    /// those columns, from the first, that are not zero, half of them in all.
    panels: Arc<Vec<(usize, DMatrix<f64>)>>,
    /// Half the ln of the determinant.
    pub(crate) ln_spread: f64,
}

impl Whitening {
    /// `None` if the covariance is not positive definite.
    pub(crate) fn new(covariance: DMatrix<f64>) -> Option<Self> {
        let rows = covariance.nrows();
        let lower = covariance.cholesky()?.unpack();
        let ln_spread = lower.diagonal().iter().map(|x| x.ln()).sum();
        let inverse = lower.solve_lower_triangular(&DMatrix::identity(rows, rows))?;
        let panel = |from: usize| {
            let own = inverse.rows(from, PANEL_ROWS.min(rows - from));
            let first = own.column_iter().position(|column| column.iter().any(|x| *x != 0.0)).unwrap_or(from);
            (first, own.columns(first, from + own.nrows() - first).into_owned())
        };
        let panels = Arc::new((0..rows).step_by(PANEL_ROWS).map(panel).collect());
        Some(Whitening { panels, ln_spread })
    }

    /// Whitens columns.
    pub(crate) fn apply(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut whitened = DMatrix::zeros(columns.nrows(), columns.ncols());
        for (number, (first, panel)) in self.panels.iter().enumerate() {
            let own = columns.rows(*first, panel.ncols());
            whitened.rows_mut(number * PANEL_ROWS, panel.nrows()).gemm(1.0, panel, &own, 0.0);
        }
        whitened
    }
}
