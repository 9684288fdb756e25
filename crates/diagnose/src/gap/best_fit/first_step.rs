//! The initial metal temperature is not a machine property. A fit without the first step still takes it from that step.

use crate::gap::best_fit::fit::{Fit, MAX_SIGMAS};
use crate::gap::best_fit::selection::dot_over;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use nalgebra::{DMatrix, DVector};

/// Refits only the initial state to the first step. Otherwise the unknown start temperature would count as a machine misfit of a held-out first
/// step, a hundred times too large. Returns the fit unchanged if the misfit of the first step does not fall.
pub fn with_start_read(study: &Study, linearised: &Linearised, fit: Fit) -> Fit {
    let rows = [rows_of_step(study, 0)];
    let starts: Vec<usize> =
        study.nuisances.iter().enumerate().filter(|(_, n)| n.kind.is_start()).map(|(i, _)| i).collect();
    let column = |place: usize| &linearised.columns[starts[place]];
    let n = starts.len();
    let matrix =
        DMatrix::from_fn(n, n, |i, j| dot_over(&rows, column(i), column(j)) + if i == j { 1.0 } else { 0.0 });
    let right = DVector::from_fn(n, |i, _| {
        dot_over(&rows, column(i), &fit.residual) - fit.hypothesis.nuisances[starts[i]]
    });
    let Some(step) = matrix.cholesky().map(|cholesky| cholesky.solve(&right)) else { return fit };
    let mut moved = fit.hypothesis.clone();
    for (index, by) in starts.iter().zip(step.iter()) {
        moved.nuisances[*index] = (moved.nuisances[*index] + by).clamp(-MAX_SIGMAS, MAX_SIGMAS);
    }
    let Ok(prediction) = study.predict(&moved) else { return fit };
    let residual = linearised.residual(study, &prediction);
    if dot_over(&rows, &residual, &residual) >= dot_over(&rows, &fit.residual, &fit.residual) {
        return fit;
    }
    Fit { hypothesis: moved, prediction, residual, ..fit }
}
