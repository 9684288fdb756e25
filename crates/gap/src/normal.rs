//! The normal equations of nuisances and effects.

use crate::selection::{Selection, dot_over};
use crate::study::{Hypothesis, Study};
use crate::whiten::Linearised;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;

/// Prior width of an effect's parameter, in typical steps.
pub const PRIOR_STEPS: f64 = 10.0;

/// Products of the nuisances' columns over the steps that count.
pub(crate) fn nuisance_products(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
) -> DMatrix<f64> {
    let n = study.nuisances.len();
    let counted = linearised.products.iter().zip(&selection.steps).filter(|(_, counts)| **counts);
    counted.fold(DMatrix::zeros(n, n), |sum, (products, _)| sum + products)
}

/// Precision of nuisances, priors of one sigma included, and of columns beside them.
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
        // Next to nothing: keeps the equations solvable where a parameter does nothing.
        matrix[(n + j, n + j)] += 1e-6;
    }
    matrix
}

/// The normal equations of one iteration: nuisances first, effects behind them.
#[derive(Debug, Default)]
pub(crate) struct Normal {
    pub matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    pub fn new(
        rows: &[std::ops::Range<usize>],
        linearised: &Linearised,
        nuisance_products: &DMatrix<f64>,
        effect_columns: &[Vec<f64>],
        residual: &[f64],
        hypothesis: &Hypothesis,
    ) -> Normal {
        let n = hypothesis.nuisances.len();
        let ask = |column: &Vec<f64>| dot_over(rows, column, residual);
        let pulled =
            linearised.columns.iter().zip(&hypothesis.nuisances).map(|(c, nuisance)| ask(c) - nuisance);
        let right =
            DVector::from_iterator(n + effect_columns.len(), pulled.chain(effect_columns.iter().map(ask)));
        let matrix = normal_matrix(rows, linearised, nuisance_products, effect_columns);
        Normal { matrix, right }
    }

    /// The step with some unknowns held to given steps, and what it promises in the cost.
    pub fn solve(&self, held: &[Option<f64>]) -> Option<(DVector<f64>, f64)> {
        let free: Vec<usize> = (0..held.len()).filter(|i| held[*i].is_none()).collect();
        let mut step = DVector::from_fn(held.len(), |i, _| held[i].unwrap_or(0.0));
        let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| self.matrix[(free[i], free[j])]);
        let pushed = &self.matrix * &step;
        let right = DVector::from_fn(free.len(), |i, _| self.right[free[i]] - pushed[free[i]]);
        let part = matrix.cholesky()?.solve(&right);
        for (place, index) in free.iter().enumerate() {
            step[*index] = part[place];
        }
        let promised = 2.0 * step.dot(&self.right) - step.dot(&(&self.matrix * &step));
        Some((step, promised))
    }

    /// Laplace's evidence, and the covariance of the effects' coordinates.
    pub fn evidence(&self, cost: f64, nuisances: usize) -> (f64, DMatrix<f64>) {
        let effects = self.matrix.nrows() - nuisances;
        let Some(cholesky) = self.matrix.clone().cholesky() else {
            return (f64::NEG_INFINITY, DMatrix::from_element(effects, effects, f64::INFINITY));
        };
        let half_ln_determinant = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let each = 0.5 * (2.0 * std::f64::consts::PI).ln() - PRIOR_STEPS.ln();
        let score = -0.5 * cost - half_ln_determinant + effects as f64 * each;
        (score, covariance_of_effects(&cholesky, nuisances))
    }
}

fn covariance_of_effects(cholesky: &Cholesky<f64, Dyn>, nuisances: usize) -> DMatrix<f64> {
    let inverse = cholesky.inverse();
    let effects = inverse.nrows() - nuisances;
    inverse.view((nuisances, nuisances), (effects, effects)).into_owned()
}
