//! Tests whether the residual of a fit is noise. A misfit is smooth, so the test uses a few smooth directions: among thousands of noisy values
//! the misfit would be invisible.

use crate::gap::best_fit::fit::Fit;
use crate::gap::best_fit::normal::Selection;
use crate::gap::residuals::nuisance::RESPONSES_S;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::{Linearised, dot, rows_of_step};

/// Length of a direction that counts as none, in sigmas. Bound: rounding of the orthogonalisation.
const NO_LENGTH: f64 = 1e-6;

/// Residual of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Adequacy {
    /// Energy in the smooth basis above its expectation, in its standard deviations.
    pub smooth_sigma: f64,
    /// Energy in the smooth basis above its expectation.
    pub smooth_excess: f64,
    /// Scatter of the effect's parameters from step to step above its expectation, in standard deviations; 0 without effects.
    pub scatter_sigma: f64,
}

impl Adequacy {
    /// Features for the probability of an unmodelled cause.
    pub fn features(&self) -> [f64; 2] {
        [self.smooth_sigma, self.scatter_sigma]
    }
}

/// Energy of a whitened residual in each group's smooth basis.
pub(crate) fn smooth_energies(study: &Study, linearised: &Linearised, residual: &[f64]) -> Vec<f64> {
    study
        .groups
        .iter()
        .enumerate()
        .map(|(index, group)| {
            let here = &residual[group.rows.clone()];
            let mut directions: Vec<Vec<f64>> = Vec::new();
            for decay_s in RESPONSES_S.iter().take(here.len()) {
                let since_s = |block: &usize| study.steps[group.step].blocks[*block].since_jump_s;
                let mut direction: Vec<f64> =
                    group.blocks.iter().map(|block| (-since_s(block) / decay_s).exp()).collect();
                linearised.whiten_group(index, &mut direction);
                // Gram-Schmidt orthogonalisation.
                for before in &directions {
                    let along = dot(&direction, before);
                    for (d, b) in direction.iter_mut().zip(before) {
                        *d -= along * b;
                    }
                }
                let length = dot(&direction, &direction).sqrt();
                if length > NO_LENGTH {
                    directions.push(direction.into_iter().map(|d| d / length).collect());
                }
            }
            directions.iter().map(|direction| dot(direction, here).powi(2)).sum()
        })
        .collect()
}

/// Evaluates the residual of a fit on all steps.
pub(crate) fn adequacy(study: &Study, linearised: &Linearised, fit: &Fit) -> Adequacy {
    let energies = smooth_energies(study, linearised, &fit.residual);
    let expected: f64 = study.groups.iter().map(|group| RESPONSES_S.len().min(group.rows.len()) as f64).sum();
    let smooth_excess = energies.iter().sum::<f64>() - expected;
    let everywhere = Selection::all(study);
    let mut scatter_sigma: f64 = 0.0;
    for column in &fit.effect_columns {
        let (mut sum, mut count) = (0.0, 0.0);
        for rows in everywhere.rows(study) {
            let own = dot(&column[rows.clone()], &column[rows.clone()]);
            if own > 1.0 {
                sum += dot(&column[rows.clone()], &fit.residual[rows]).powi(2) / own;
                count += 1.0;
            }
        }
        if count > 1.0 {
            scatter_sigma = scatter_sigma.max((sum - count) / (2.0f64 * count).sqrt());
        }
    }
    let smooth_sigma = smooth_excess / (2.0 * expected.max(1.0)).sqrt();
    Adequacy { smooth_sigma, smooth_excess, scatter_sigma }
}

/// Misfit of each step: `(|r|^2 - n)/n`.
pub(crate) fn misfit_of_steps(study: &Study, residual: &[f64]) -> Vec<f64> {
    (0..study.steps.len())
        .map(|step| {
            let rows = rows_of_step(study, step);
            let n = rows.len().max(1) as f64;
            (dot(&residual[rows.clone()], &residual[rows]) - n) / n
        })
        .collect()
}
