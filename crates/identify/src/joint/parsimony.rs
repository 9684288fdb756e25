//! Keeps to what was declared unless the recording speaks against it.
//!
//! Each refinement (alpha_A, the probe, the direction factor) that is free costs the points some certainty, also on a
//! machine that needs none of it. So the declared value has a weight of its own beforehand, as much as all other values
//! together. The ratio of the densities after and before at the declared value (Savage and Dickey; e.g. Kass and Raftery,
//! Bayes Factors, 1995) says what is left of it; mean and variance of the mixture then make the prior of the last fit.

use crate::joint::parameters::{ALPHA, LN_DIRECTION, PROBE_MM2, Prior};
use crate::joint::solve::{FULLY, Problem};

/// The refinements.
const REFINEMENTS: [usize; 3] = [PROBE_MM2, LN_DIRECTION, ALPHA];

/// Takes the refinements one after the other, the least needed first, and fits again after each.
pub(crate) fn settle(problem: &mut Problem<'_>) -> Option<()> {
    let mut left: Vec<usize> = REFINEMENTS.into_iter().filter(|index| problem.active[*index]).collect();
    while !left.is_empty() {
        let covariance = problem.covariance()?;
        let judged: Vec<(usize, f64, Prior)> = left
            .iter()
            .filter_map(|index| {
                let (weight, prior) = mixture(
                    problem.priors[*index],
                    problem.shared[*index],
                    covariance.error_of(*index)?,
                    problem.information(*index)?,
                )?;
                Some((*index, weight, prior))
            })
            .collect();
        let Some((index, _, prior)) = judged.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        left.retain(|other| *other != index && problem.active[*other]);
        problem.priors[index] = prior;
        problem.minimise(FULLY)?;
    }
    Some(())
}

/// Probability that a value other than the declared one holds, and the prior with which the fit gives the mixture's mean
/// and variance; `None` for errors that are no number.
///
/// `information`: one over the variance that least squares alone gives, without the prior.
fn mixture(prior: Prior, found: f64, error: f64, information: f64) -> Option<(f64, Prior)> {
    if !(information.is_finite() && information > 0.0 && error > 0.0) {
        return None;
    }
    let distance = (found - prior.mean) / error;
    let odds_declared = prior.sigma / error * (-0.5 * distance * distance).exp();
    let weight = 1.0 / (1.0 + odds_declared);
    let variance = weight * (error * error + (1.0 - weight) * (found - prior.mean).powi(2));
    // The fit draws by prior over information; what it has to draw is what is left of the variance.
    let drawn = (variance / (error * error)).min(1.0);
    let needed = information * (1.0 / drawn - 1.0);
    let sigma = if needed > prior.weight() { needed.powf(-0.5) } else { prior.sigma };
    Some((weight, Prior { mean: prior.mean, sigma }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRIOR: Prior = Prior { mean: 0.0, sigma: 0.3 };

    #[test]
    fn a_clear_finding_is_left_alone_and_none_is_drawn_to_the_declared_value() {
        let (sure, kept) = mixture(PRIOR, 0.2, 0.01, 1e4).unwrap();
        assert!(sure > 0.999 && kept.sigma > 0.1);
        let (doubtful, drawn) = mixture(PRIOR, 0.005, 0.02, 2.5e3).unwrap();
        assert!(doubtful < 0.1 && drawn.sigma < 0.01);
    }
}
