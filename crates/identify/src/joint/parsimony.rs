//! Keeps to what was declared unless the recording speaks against it.
//!
//! Each refinement (alpha_A, the probe, the direction factor) that is free costs the points some certainty, also on a
//! machine that needs none of it, and the small faults of any model look like a little of each. So every choice of which of
//! them are at work is weighed: the density, after the fit, of the declared values of those that are not, over their
//! density before (Savage and Dickey; e.g. Kass and Raftery, Bayes Factors, 1995), with an error of its own for what the
//! model does not know. A refinement is then drawn towards the declared value by the weight of the choices without it, and
//! what that leaves open is carried on as variance: enough that the 95 % interval about the drawn value reaches as far as
//! the mixture of both answers does. Its plain variance would not, since the mixture has a long tail on one side.

use crate::joint::parameters::{ALPHA, ETA, LN_DIRECTION, PROBE_MM2, SHARED};
use crate::joint::solve::{Covariance, FULLY, Problem};
use mapper_numerics::statistics::{NORMAL_975, mean, normal_quantile};
use nalgebra::{DMatrix, DVector};

/// The refinements, and for each what small faults of the model can pass for: a clearance that grows by a percent as the
/// housing warms up by 100 K looks like 0.06 of alpha_A.
const REFINEMENTS: [(usize, f64); 3] = [(PROBE_MM2, 0.1), (LN_DIRECTION, 0.015), (ALPHA, 0.025)];
/// Probability beforehand that a refinement is not at work.
pub(crate) const DECLARED_HOLDS: f64 = 0.67;
/// Share of the mixture that may lie beyond the interval on the side of what was found. With 1 % an alpha_A of 0.05 that hardly
/// shows is contained more often, and on all other machines the intervals of h are twice as wide as its errors.
const BEYOND: f64 = 0.025;
/// Weight of a refinement above which it is left alone.
const SURE: f64 = 0.999;

/// By how much the efficiencies would be off, fraction (rms of one standard error), if a refinement that is drawn to its
/// declared value were at work after all: what is known of them without the declaration. 0 where none is drawn.
pub(crate) fn resting_on_declaration(open: &Problem<'_>, settled: &Problem<'_>) -> Option<f64> {
    let drawn = |(index, _): &(usize, f64)| {
        open.active[*index] && settled.priors[*index].sigma < 0.5 * open.priors[*index].sigma
    };
    let drawn: Vec<usize> = REFINEMENTS.iter().filter(|one| drawn(one)).map(|(index, _)| *index).collect();
    if drawn.is_empty() {
        return Some(0.0);
    }
    let mut held = open.clone();
    drawn.iter().for_each(|index| held.active[*index] = false);
    let (open, held) = (open.covariance()?, held.covariance()?);
    let variance = |covariance: &Covariance, i: usize| covariance.own.get(i).map(|(own, _)| own[(ETA, ETA)]);
    let of_steps: Vec<f64> = (0..open.own.len())
        .filter_map(|i| Some((variance(&open, i)? - variance(&held, i)?).max(0.0)))
        .collect();
    Some(mean(&of_steps)?.sqrt())
}

/// Weighs the refinements, draws the least needed by its weight, fits again, and weighs those that are left: one that was
/// only balanced by another shows what it is when the other is gone.
pub(crate) fn settle(problem: &mut Problem<'_>) -> Option<()> {
    let mut settled = Vec::new();
    loop {
        let covariance = problem.covariance()?;
        let left = weights(problem, &covariance).into_iter().filter(|(index, _)| !settled.contains(index));
        let Some((index, weight)) = left.min_by(|a, b| a.1.total_cmp(&b.1)) else { return Some(()) };
        settled.push(index);
        if weight > SURE {
            continue;
        }
        let information = problem.information(index)?;
        if !(information.is_finite() && information > 0.0) {
            continue;
        }
        let found = problem.shared[index] - problem.priors[index].mean;
        let before = problem.priors[index].weight();
        let drawn = (information * (1.0 / weight.max(1e-6) - 1.0)).max(before);
        let (sigma, left) = ((information + before).powf(-0.5), 1.0 / (information + drawn));
        problem.extra_variances[index] = extra_variance(weight, found.abs(), sigma, left);
        problem.priors[index].sigma = drawn.powf(-0.5);
        problem.minimise(FULLY)?;
    }
}

/// Variance beyond that of the drawn fit, which is `left`: see above. `found`: distance of what was found from the declared
/// value; `sigma`: its standard error.
fn extra_variance(weight: f64, found: f64, sigma: f64, left: f64) -> f64 {
    let plain = weight * (1.0 - weight) * found * found;
    // Where less than that is beyond the declared value, the tail ends there.
    let Some(quantile) = normal_quantile(1.0 - BEYOND / weight) else { return plain };
    let reach = (found + quantile * sigma - weight * found).max(0.0) / NORMAL_975;
    plain.max(reach * reach - left)
}

/// Probability of each active refinement to be at work.
fn weights(problem: &Problem<'_>, covariance: &Covariance) -> Vec<(usize, f64)> {
    let active: Vec<(usize, usize, f64)> = REFINEMENTS
        .into_iter()
        .filter(|(index, _)| problem.active[*index])
        .filter_map(|(index, floor)| Some((index, covariance.row_of(index)?, floor)))
        .collect();
    let found: Vec<f64> =
        active.iter().map(|(index, ..)| problem.shared[*index] - problem.priors[*index].mean).collect();
    let sigmas: Vec<f64> = active.iter().map(|(index, ..)| problem.priors[*index].sigma).collect();
    let spread = DMatrix::from_fn(active.len(), active.len(), |a, b| {
        let floor = if a == b { active[a].2.powi(2) } else { 0.0 };
        covariance.shared[(active[a].1, active[b].1)] + floor
    });
    let on = at_work(&found, &sigmas, &spread);
    active.iter().zip(on).map(|((index, ..), weight)| (*index, weight)).collect()
}

/// The same from what was found (minus what was declared), the standard deviations beforehand, and the covariance after.
fn at_work(found: &[f64], sigmas: &[f64], spread: &DMatrix<f64>) -> Vec<f64> {
    let count = found.len();
    // For each set of those that are not at work the logarithm of its probability, but for a constant.
    let logs: Vec<f64> = (0..1usize << count)
        .map(|off| {
            let without: Vec<usize> = (0..count).filter(|i| off >> i & 1 == 1).collect();
            let before: f64 = without.iter().map(|i| sigmas[*i].ln()).sum();
            let odds = without.len() as f64 * (DECLARED_HOLDS / (1.0 - DECLARED_HOLDS)).ln();
            let part =
                DMatrix::from_fn(without.len(), without.len(), |a, b| spread[(without[a], without[b])]);
            let distance = DVector::from_iterator(without.len(), without.iter().map(|i| found[*i]));
            if without.is_empty() {
                return 0.0;
            }
            let Some(factors) = part.cholesky() else { return f64::NEG_INFINITY };
            let determinant: f64 = factors.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
            odds + before - determinant - 0.5 * distance.dot(&factors.solve(&distance))
        })
        .collect();
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = logs.iter().map(|log| (log - best).exp()).sum();
    (0..count)
        .map(|i| {
            let with = logs.iter().enumerate().filter(|(off, _)| off >> i & 1 == 0);
            with.map(|(_, log)| (log - best).exp()).sum::<f64>() / total
        })
        .collect()
}

/// No variance beyond that of the fit.
pub(crate) const NO_EXTRA: [f64; SHARED] = [0.0; SHARED];

#[cfg(test)]
mod tests {
    use super::*;

    fn diagonal(errors: &[f64]) -> DMatrix<f64> {
        DMatrix::from_diagonal(&DVector::from_iterator(errors.len(), errors.iter().map(|e| e * e)))
    }

    /// The interval about the drawn value leaves 2.5 % of the mixture beyond it, by counting (numbers at equal ranks).
    #[test]
    fn the_interval_reaches_as_far_as_the_mixture() {
        for (weight, found, sigma) in [(0.1, 0.05, 0.02), (0.3, 0.05, 0.03), (0.9, 0.08, 0.03)] {
            let left = weight * sigma * sigma;
            let variance = left + extra_variance(weight, found, sigma, left);
            let upper = weight * found + NORMAL_975 * variance.sqrt();
            let ranks = 1_000_000;
            let beyond = (1..ranks)
                .filter(|rank| {
                    let share = f64::from(*rank) / f64::from(ranks);
                    normal_quantile(share).is_some_and(|z| found + z * sigma > upper)
                })
                .count();
            let left = weight * beyond as f64 / f64::from(ranks);
            assert!(left < BEYOND + 1e-4, "{weight} {found} {sigma}: {left}");
        }
    }

    #[test]
    fn a_clear_finding_is_left_alone_and_none_is_drawn_to_the_declared_value() {
        assert!(at_work(&[0.2], &[0.3], &diagonal(&[0.02]))[0] > SURE);
        // Half its error: twice as likely not to be there beforehand, and then 13 times as dense as before.
        assert!(at_work(&[0.01], &[0.3], &diagonal(&[0.02]))[0] < 0.05);
    }

    /// Two that stand for each other, each two of its errors off, are less than either of them for certain.
    #[test]
    fn what_only_balances_another_is_not_at_work() {
        let errors = [0.02f64, 0.02];
        let mut spread = diagonal(&errors);
        spread[(0, 1)] = 0.95 * errors[0] * errors[1];
        spread[(1, 0)] = spread[(0, 1)];
        let together = at_work(&[0.045, 0.045], &[0.3, 0.3], &spread);
        assert!(together.iter().all(|weight| *weight < 0.3), "{together:?}");
    }
}
