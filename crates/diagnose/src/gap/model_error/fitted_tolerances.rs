//! Tolerances of a fault-free rig.

use crate::gap::best_fit::fit::MAX_SIGMAS;
use crate::gap::best_fit::normal::nuisance_products;
use crate::gap::best_fit::selection::{Selection, dot_over};
use crate::gap::residuals::hypothesis::Hypothesis;
use crate::gap::residuals::study::{PredictError, Study};
use crate::gap::residuals::whiten::{Linearised, dot};
use mapper_numerics::least_squares::descent::ROUNDS;
use nalgebra::{DMatrix, DVector};

/// Fits the tolerances of a fault-free rig. The misfit sets the noise level, so that model error does not push tolerances outside their
/// priors.
pub(crate) fn fitted_tolerances(study: &Study, linearised: &Linearised) -> Result<Hypothesis, PredictError> {
    let everywhere = Selection::all(study);
    let products = nuisance_products(study, linearised, &everywhere);
    let rows = everywhere.rows(study);
    let (mut best, mut residual) = (study.nothing(), linearised.residual(study, &linearised.base));
    let n = best.nuisances.len();
    for _ in 0..ROUNDS {
        let excess = (dot(&residual, &residual) / residual.len().max(1) as f64).max(1.0);
        let matrix = &products + DMatrix::identity(n, n) * excess;
        let right = DVector::from_fn(n, |i, _| {
            dot_over(&rows, &linearised.columns[i], &residual) - excess * best.nuisances[i]
        });
        let Some(step) = matrix.cholesky().map(|cholesky| cholesky.solve(&right)) else { break };
        let mut moved = best.clone();
        for (sigmas, by) in moved.nuisances.iter_mut().zip(step.iter()) {
            *sigmas = (*sigmas + by).clamp(-MAX_SIGMAS, MAX_SIGMAS);
        }
        let there = linearised.residual_of(study, &moved)?;
        let cost = |residual: &[f64], at: &Hypothesis| {
            dot(residual, residual) / excess + dot(&at.nuisances, &at.nuisances)
        };
        if cost(&there, &moved) >= cost(&residual, &best) {
            break;
        }
        (best, residual) = (moved, there);
    }
    Ok(best)
}
