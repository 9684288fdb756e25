//! Keeps to what was declared unless the recording speaks against it.
//!
//! Each refinement (alpha_A, the probe, the direction factor) that is free costs the points some certainty, also on a
//! machine that needs none of it, and the small faults of any model look like a little of each. So every choice of which of
//! them are at work is weighed: the density, after the fit, of the declared values of those that are not, over their
//! density before (Savage and Dickey; e.g. Kass and Raftery, Bayes Factors, 1995), with an error of its own for what the
//! model does not know. A refinement is then drawn towards the declared value by the weight of the choices without it, and
//! what that leaves open is carried on as variance: enough that the 95 % interval about the drawn value reaches as far as
//! the mixture of all answers does. Its plain variance would not, since the mixture has a long tail on one side.
//!
//! alpha_A is a share of an area: beforehand, and after, it lies between 0 and 1. A fit that comes out below 0 by chance speaks for
//! what is declared and not for something at work. One that comes out there by more than chance is left alone: it is the model
//! that is then doubted.

use crate::joint::parameters::{ALPHA, ETA, LN_DIRECTION, PROBE_MM2, SHARED};
use crate::joint::seen::{Bounds, Mixture, Seen};
use crate::joint::solve::{Covariance, FULLY, Problem};
use mapper_numerics::statistics::mean;
use nalgebra::{DMatrix, DVector};

/// What small faults of the model can pass for, as a change of alpha_A: a clearance that grows by a percent as the housing warms up
/// by 100 K looks like 0.06.
pub(crate) const ALPHA_FLOOR: f64 = 0.025;
/// The refinements, and for each what small faults of the model can pass for.
const REFINEMENTS: [(usize, f64); 3] = [(PROBE_MM2, 0.1), (LN_DIRECTION, 0.015), (ALPHA, ALPHA_FLOOR)];
/// Standard errors outside its range up to which a refinement is there by chance.
const BY_CHANCE_SIGMAS: f64 = 3.0;
/// Probability beforehand that a refinement is not at work. With two thirds an alpha_A of some 0.04 that chance hides passed for none more
/// often than intervals of 95 % may (docs/coverage.md); on machines as declared intervals are a third narrower then.
pub(crate) const DECLARED_HOLDS: f64 = 0.5;
/// Weight of a refinement above which it is left alone.
const SURE: f64 = 0.999;

/// Holds the refinements where they are declared.
pub(crate) fn hold_refinements(problem: &mut Problem<'_>) {
    for (index, _) in REFINEMENTS {
        problem.active[index] = false;
        problem.shared[index] = problem.priors[index].mean;
    }
}

/// By how much the efficiencies would be off, fraction (rms of one standard error), if a refinement that is drawn to its
/// declared value were at work after all: what is known of them without the declaration. 0 where none is drawn.
pub(crate) fn resting_on_declaration(open: &Problem<'_>, settled: &Problem<'_>) -> Option<f64> {
    resting_on(open, |index| settled.priors[index].sigma < 0.5 * open.priors[index].sigma)
}

/// The same if all refinements that the method may find were at work.
pub(crate) fn resting_on_all(open: &Problem<'_>) -> Option<f64> {
    resting_on(open, |_| true)
}

fn resting_on(open: &Problem<'_>, drawn: impl Fn(usize) -> bool) -> Option<f64> {
    let drawn: Vec<usize> = REFINEMENTS
        .into_iter()
        .map(|(index, _)| index)
        .filter(|index| open.active[*index] && drawn(*index))
        .collect();
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
        let left = weighed(problem, &covariance).into_iter().filter(|(index, _)| !settled.contains(index));
        let Some((index, mixture)) = left.min_by(|a, b| a.1.weight().total_cmp(&b.1.weight())) else {
            return Some(());
        };
        settled.push(index);
        let weight = mixture.weight();
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
        problem.extra_variances[index] = mixture.variance_beyond(weight * found, 1.0 / (information + drawn));
        problem.priors[index].sigma = drawn.powf(-0.5);
        problem.minimise(FULLY)?;
    }
}

/// What each active refinement may be, as a distance from what is declared.
fn weighed(problem: &Problem<'_>, covariance: &Covariance) -> Vec<(usize, Mixture)> {
    let active: Vec<(usize, usize, f64)> = REFINEMENTS
        .into_iter()
        .filter(|(index, _)| problem.active[*index])
        .filter_map(|(index, floor)| Some((index, covariance.row_of(index)?, floor)))
        .collect();
    let found = DVector::from_iterator(
        active.len(),
        active.iter().map(|(index, ..)| problem.shared[*index] - problem.priors[*index].mean),
    );
    let spread =
        DMatrix::from_fn(active.len(), active.len(), |a, b| covariance.shared[(active[a].1, active[b].1)]);
    let floors = active.iter().map(|(.., floor)| *floor).collect();
    let sigmas = active.iter().map(|(index, ..)| problem.priors[*index].sigma).collect();
    let bounds = active.iter().enumerate().find(|(_, (index, ..))| *index == ALPHA).and_then(
        |(place, (.., floor))| {
            let declared = problem.priors[ALPHA].mean;
            let (low, high) = (-declared, 1.0 - declared);
            let outside = (low - found[place]).max(found[place] - high);
            let by_chance = outside < BY_CHANCE_SIGMAS * spread[(place, place)].sqrt().hypot(*floor);
            by_chance.then_some(Bounds { place, low, high })
        },
    );
    let mixtures = Seen { found, sigmas, spread, floors, bounds, declared_holds: DECLARED_HOLDS }.mixtures();
    active.into_iter().map(|(index, ..)| index).zip(mixtures).collect()
}

/// No variance beyond that of the fit.
pub(crate) const NO_EXTRA: [f64; SHARED] = [0.0; SHARED];
