//! Refinements of the joint fit, the preheating in the inlet among them.
//!
//! Each free parameter increases the uncertainty of the points, even if the machine does not need it. Small model errors also look like a
//! small value of each. So each one is neutral or free, and all sets are evaluated on the Gaussian of a fit with all of them free
//! ([`mapper_inference::mixture`]). The fit moves to the mean of the mixture and is linearised again there, because the probe's lag is far
//! from linear. The spread of the mixture then enters the uncertainty of every number of every point.

use crate::IdentifyConfig;
use crate::faults::end_readings::ANY_ROUGHNESS;
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::fit::step_noise;
use crate::joint::step_model::parameters::{
    ALPHA, ETA, INLET, LN_COEFFICIENT, PREHEAT, Prior, REFINEMENTS, Refinement,
};
use crate::joint::step_model::parts::Parts;
use mapper_core::{IdentifiedInlet, InletConvection, Origin, standard_error_of};
use mapper_inference::mixture::{Draw, Mixture, Parameter};
use mapper_inference::posterior::{self, COVERAGE};
use mapper_numerics::statistics::{HINT_SIGMAS, mean};
use nalgebra::{DMatrix, DVector, Matrix4xX};
use std::collections::BTreeMap;

/// The joint distribution of the parameters with a prior.
#[derive(Debug, Clone)]
pub(crate) struct Refinements {
    pub(crate) indices: Vec<usize>,
    pub(crate) mixture: Mixture,
    /// Current values, as differences from the declared values.
    at: DVector<f64>,
    /// Best-fit values with all of them free, as differences from the declared values, and their standard errors.
    free: Vec<(f64, f64)>,
}

/// Regression of every shared parameter on these parameters.
#[derive(Debug, Clone)]
pub(crate) struct Gain(pub(crate) DMatrix<f64>);

/// Preheating that the parts of a housing imitate whose gas touches several temperatures, W/K: heat leaves it where it is hotter than its
/// thermocouple. Bound: conductances of 2 to 20 W/K between parts give 0.2 to 2 W/K where there is none.
const DIVIDED_PREHEAT_W_K: f64 = 1.0;

/// The parameters that a problem searches for.
pub(crate) fn sought(problem: &Problem<'_>) -> Vec<Refinement> {
    let is_divided = problem.model.parts == Parts::Three;
    let of_problem = |refinement: Refinement| {
        let imitated = if is_divided && refinement.index == PREHEAT { DIVIDED_PREHEAT_W_K } else { 0.0 };
        let left_over = problem.left_over[refinement.index].hypot(imitated);
        Refinement { model_error: refinement.model_error.hypot(left_over), ..refinement }
    };
    let active = REFINEMENTS.into_iter().filter(|refinement| problem.active[refinement.index]);
    active.map(of_problem).collect()
}

/// Fixes these parameters at their declared values.
pub(crate) fn hold(problem: &mut Problem<'_>) {
    for Refinement { index, .. } in REFINEMENTS {
        problem.active[index] = false;
        problem.shared[index] = problem.priors[index].mean;
    }
}

/// Error of the efficiencies, fraction (rms of one standard error), if parameters that are taken for neutral differ from that as those of
/// machines do, and the recording alone determines them: the part of their variance that knowing these parameters removes, averaged over the sets
/// of the mixture. `None` as `found`: all are taken for neutral.
pub(crate) fn prior_sensitivity(open: &Problem<'_>, found: Option<&Refinements>) -> Option<f64> {
    let covariance = open.covariance()?;
    let refinements = sought(open);
    let rows: Vec<Option<usize>> =
        refinements.iter().map(|refinement| covariance.row_of(refinement.index)).collect();
    // The fit has a wider prior, so that it does not hide what the recording says.
    let weight_change = |row: usize| {
        let place = rows.iter().position(|other| *other == Some(row));
        place.and_then(|place| refinements.get(place)).map_or(0.0, |refinement| {
            refinement.slab_sigma.powi(-2) - open.priors[refinement.index].sigma.powi(-2)
        })
    };
    let mut sets: BTreeMap<Vec<usize>, f64> = BTreeMap::new();
    match found {
        None => _ = sets.insert(rows.iter().copied().flatten().collect(), 1.0),
        Some(found) => {
            for Draw { weight, values } in &found.mixture.draws {
                let neutral = rows.iter().zip(values.iter()).filter(|(_, value)| **value == 0.0);
                *sets.entry(neutral.filter_map(|(row, _)| *row).collect()).or_default() += weight;
            }
        }
    }
    let removed = |neutral: &[usize]| -> Option<f64> {
        let count = neutral.len();
        let information = DMatrix::from_fn(count, count, |a, b| covariance.shared[(neutral[a], neutral[b])])
            .cholesky()?
            .inverse();
        let changes = DVector::from_iterator(count, neutral.iter().map(|row| weight_change(*row)));
        let narrowed = (&information + DMatrix::from_diagonal(&changes)).cholesky()?;
        let of_step = |(_, mixed): &(_, Matrix4xX<f64>)| {
            let with = DVector::from_iterator(count, neutral.iter().map(|row| mixed[(ETA, *row)]));
            let per_parameter = &information * with;
            per_parameter.dot(&narrowed.solve(&per_parameter))
        };
        mean(covariance.own.iter().map(of_step))
    };
    let variance: Option<f64> = sets.iter().map(|(neutral, weight)| Some(weight * removed(neutral)?)).sum();
    Some(variance?.max(0.0).sqrt())
}

/// Evaluates the mixture of a problem at its minimum and moves the problem to the mean of the mixture; `Some(None)` if there is nothing to
/// search for.
pub(crate) fn settle(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<Option<Refinements>> {
    let sought = sought(problem);
    if sought.is_empty() {
        return Some(None);
    }
    linearised(problem, &sought)?;
    step_noise::set(problem, config)?;
    // Again at its mean, with the noise as it is there.
    Some(Some(linearised(problem, &sought)?))
}

/// Evaluates the mixture by linearising the problem at its current values, and moves the problem to its mean.
fn linearised(problem: &mut Problem<'_>, sought: &[Refinement]) -> Option<Refinements> {
    let indices: Vec<usize> = sought.iter().map(|refinement| refinement.index).collect();
    let declared: Vec<f64> = indices.iter().map(|index| problem.priors[*index].mean).collect();
    indices.iter().for_each(|index| problem.active[*index] = true);
    let best = problem.full_step(&indices)?;
    let spread = problem.scatter(&indices)?;
    let found = DVector::from_iterator(
        indices.len(),
        best.iter().zip(&declared).map(|(best, declared)| best - declared),
    );
    let parameters: Vec<Parameter> = sought
        .iter()
        .zip(&declared)
        .map(|(refinement, declared)| {
            let lowest = if refinement.is_positive { 0.0 } else { f64::NEG_INFINITY };
            // alpha_A is a share of an area.
            let highest = if refinement.index == ALPHA { 1.0 } else { f64::INFINITY };
            Parameter {
                slab_sigma: refinement.slab_sigma,
                low: lowest - declared,
                high: highest - declared,
                model_error: refinement.model_error,
                fitted_under_sigma: problem.priors[refinement.index].sigma,
            }
        })
        .collect();
    let mixture = Mixture::of(&found, &spread, &parameters)?;
    let at = mixture.mean()?;
    for ((index, declared), at) in indices.iter().zip(&declared).zip(at.iter()) {
        problem.shared[*index] = declared + at;
        problem.active[*index] = false;
    }
    problem.minimise()?;
    indices.iter().for_each(|index| problem.active[*index] = true);
    let free = found.iter().zip(spread.diagonal().iter()).map(|(x, v)| (*x, v.sqrt())).collect();
    Some(Refinements { indices, mixture, at, free })
}

impl Refinements {
    /// Position of a parameter among the others.
    fn place(&self, index: usize) -> Option<usize> {
        self.indices.iter().position(|other| *other == index)
    }

    /// Best-fit value with all of them free, as a difference from the declared value, and its standard error; `None` if it is not searched
    /// for.
    pub(crate) fn free(&self, index: usize) -> Option<(f64, f64)> {
        self.place(index).map(|place| self.free[place])
    }

    /// Replaces the Gaussian of these parameters with the mixture.
    pub(crate) fn apply(&self, covariance: &mut Covariance) -> Option<Gain> {
        let rows: Vec<usize> = self.indices.iter().filter_map(|index| covariance.row_of(*index)).collect();
        let columns =
            |matrix: &DMatrix<f64>| DMatrix::from_fn(matrix.nrows(), rows.len(), |i, a| matrix[(i, rows[a])]);
        let block = |matrix: &DMatrix<f64>| {
            DMatrix::from_fn(rows.len(), rows.len(), |a, b| matrix[(rows[a], rows[b])])
        };
        let gain = columns(&covariance.shared) * block(&covariance.shared).cholesky()?.inverse();
        let shared = &covariance.shared;
        let across = columns(shared) * gain.transpose();
        let change = block(shared) + self.mixture.covariance()?;
        let changed = shared - &across - across.transpose() + &gain * change * gain.transpose();
        for ((own, mixed), answer) in covariance.own.iter_mut().zip(&covariance.sensitivities) {
            let after = answer * &changed;
            *own += (&after - &*mixed) * answer.transpose();
            *mixed = after;
        }
        covariance.shared = changed;
        Some(Gain(gain))
    }

    /// 95 % interval of a quantity with this value, this normal variance and this sensitivity to the shared parameters. It is the union of the
    /// shortest interval of the mixture and the interval with all parameters free: a small effect that the mixture takes for neutral must not
    /// narrow it. Also returns the signed standard error that this adds, which all quantities share.
    pub(crate) fn interval(
        &self,
        gain: &Gain,
        answer: &DVector<f64>,
        value: f64,
        variance: f64,
    ) -> Option<((f64, f64), f64)> {
        let by_refinement = gain.0.tr_mul(answer);
        let centres = |draws: &[Draw]| -> Vec<(f64, f64)> {
            let centre = |draw: &Draw| value + by_refinement.dot(&(&draw.values - &self.at));
            draws.iter().map(|draw| (draw.weight, centre(draw))).collect()
        };
        let mixed = centres(&self.mixture.draws);
        let spread: f64 = mixed.iter().map(|(weight, centre)| weight * (centre - value).powi(2)).sum();
        let sigma = (variance - spread).max(0.0).sqrt();
        let (low, high) = posterior::shortest(&mixed, sigma, COVERAGE)?;
        let free = centres(&self.mixture.all_free);
        let (free_low, free_high) = posterior::shortest(&free, sigma, COVERAGE)?;
        let (low, high) = (low.min(free_low), high.max(free_high));
        let added = (standard_error_of(low, high).powi(2) - variance).max(0.0).sqrt();
        let moved: f64 = free.iter().map(|(weight, centre)| weight * (centre - value)).sum();
        Some(((low, high), added.copysign(moved)))
    }
}

impl Gain {
    /// Adds a row for one more parameter that does not depend on these parameters.
    pub(crate) fn with_row(self, row: usize) -> Self {
        Gain(self.0.insert_row(row, 0.0))
    }
}

// Decides whether h before the wheel equals h after it or follows the law at the inlet's own diameter.
// Both models have the same parameters and predict nearly the same T2. A recording determines `h alpha_A` before the wheel and `h (1 -
// alpha_A)` after it. Another h before the wheel therefore changes alpha_A and h, but not the efficiencies. The ratio of the two laws varies
// by a few percent over a map, with the gas temperature after the wheel, and a recording can distinguish the laws only by this variation. A
// map steeper than the fitted surface has favoured the wrong model by odds of hundreds to one. So both models are fitted and compared under
// the roughness of any map. If alpha_A is fixed as declared, the models differ by some hundredths of it. Small model errors can cause the
// same change, so such a recording does not distinguish the models. The undecided difference becomes an error of every dependent quantity.

/// Maximum ratio of the distance to its linear estimate. Bound: beyond it the linearisation is not valid.
const MAX_NONLINEARITY: f64 = 2.0;

/// Degree to which h before the wheel follows the inlet's own law.
pub(crate) fn power_of(convection: InletConvection) -> f64 {
    match convection {
        InletConvection::Shared => 0.0,
        InletConvection::Own => 1.0,
    }
}

fn convection_of(power: f64) -> InletConvection {
    if power == 0.0 { InletConvection::Shared } else { InletConvection::Own }
}

/// Compares both models on a problem at its minimum and selects the other one if the recording decides for it. Returns the remaining
/// uncertainty of the power, one standard deviation; `None` if it makes no difference.
pub(crate) fn settle_inlet(problem: &mut Problem<'_>) -> Option<Option<f64>> {
    let error = problem.covariance()?.error_of(ALPHA).unwrap_or(0.0);
    // The difference of the models is then smaller than the uncertainty of alpha_A.
    if problem.shared[ALPHA] <= HINT_SIGMAS * error {
        return Some(None);
    }
    let tight = problem.surface_sigma;
    let refit_with = |problem: &mut Problem<'_>, surface_sigma: f64| {
        problem.surface_sigma = surface_sigma;
        problem.minimise()
    };
    if tight < ANY_ROUGHNESS {
        refit_with(problem, ANY_ROUGHNESS)?;
    }
    let left_open = compared(problem)?;
    refit_with(problem, tight)?;
    Some(left_open)
}

fn compared(problem: &mut Problem<'_>) -> Option<Option<f64>> {
    let declared = IdentifiedInlet {
        convection: convection_of(problem.shared[INLET]),
        diameter_m: problem.model.setting.inlet_diameter_m,
        origin: Origin::Assumed,
        probability: 1.0,
        alpha_area_otherwise_ratio: None,
    };
    problem.inlet = Some(declared);
    let Some(mut other) = problem.inlet_sought.then(|| with_other_model(problem)).flatten() else {
        return Some(None);
    };
    // With a rig's noise and errors, small errors of the balance are larger than the difference.
    let sees = problem.active[ALPHA] && !problem.model.has_balance;
    let seen = if sees { 0.5 * (problem.square() - other.square()) } else { 0.0 };
    let mut left = 1.0 / (1.0 + (-seen).exp());
    // Keep the declared model unless the recording decides against it: the other one has other efficiencies.
    if left > COVERAGE {
        std::mem::swap(problem, &mut other);
        left = 1.0 - left;
    }
    let decided = left < 1.0 - COVERAGE;
    problem.inlet = Some(IdentifiedInlet {
        convection: convection_of(problem.shared[INLET]),
        origin: if decided { Origin::Fitted } else { Origin::NotIdentifiable },
        probability: 1.0 - left,
        alpha_area_otherwise_ratio: problem.active[ALPHA].then_some(other.shared[ALPHA]),
        ..declared
    });
    // Root mean square of the distance of the truth, in units of that between the models.
    let sigma = left.sqrt();
    problem.priors[INLET] = Prior { mean: problem.shared[INLET], sigma };
    problem.active[INLET] = true;
    let curved = sigma * nonlinearity(problem, &other, &problem.covariance()?);
    problem.active[INLET] = false;
    Some(Some(curved))
}

/// Adds the undecided difference between the models to the covariance: how far each quantity moves from one towards the other.
pub(crate) fn carry(problem: &mut Problem<'_>, sigma: f64, without: &Covariance) -> Option<Covariance> {
    problem.priors[INLET].sigma = sigma;
    problem.active[INLET] = true;
    let mut with = problem.covariance()?;
    let own = with.row_of(INLET)?;
    // The answer of the fit to another power, by the regression on it.
    let moved = with.shared.column(own) * (sigma / with.shared[(own, own)]);
    let place = |row: usize| if row < own { Some(row) } else { row.checked_sub(1).filter(|_| row > own) };
    with.shared = DMatrix::from_fn(moved.len(), moved.len(), |a, b| {
        let known = place(a).zip(place(b)).map_or(0.0, |(a, b)| without.shared[(a, b)]);
        known + moved[a] * moved[b]
    });
    for (i, answer) in with.sensitivities.iter().enumerate() {
        let (own_before, mixed_before) = &without.own[i];
        let alone = own_before - mixed_before * without.sensitivities[i].transpose();
        let mixed = answer * &with.shared;
        with.own[i] = (alone + &mixed * answer.transpose(), mixed);
    }
    Some(with)
}

/// Ratio of the distance between the two fits to its linear estimate. The dependence is curved because only the product of alpha_A and h is
/// determined.
fn nonlinearity(problem: &Problem<'_>, other: &Problem<'_>, covariance: &Covariance) -> f64 {
    let Some(own) = covariance.row_of(INLET) else { return 1.0 };
    let way = other.shared[INLET] - problem.shared[INLET];
    [ALPHA, LN_COEFFICIENT]
        .into_iter()
        .filter_map(|index| Some((index, covariance.row_of(index)?)))
        .map(|(index, row)| {
            let straight = way * covariance.shared[(row, own)] / covariance.shared[(own, own)];
            (other.shared[index] - problem.shared[index]) / straight
        })
        .filter(|ratio| ratio.is_finite())
        .fold(1.0, f64::max)
        .min(MAX_NONLINEARITY)
}

/// The problem at its minimum with the other model; `None` if the fit does not converge.
fn with_other_model<'a>(problem: &Problem<'a>) -> Option<Problem<'a>> {
    let mut other = problem.clone();
    other.shared[INLET] = 1.0 - problem.shared[INLET];
    let alpha = problem.shared[ALPHA];
    if problem.active[ALPHA] && alpha > 0.0 && alpha < 1.0 {
        // Start with equal heat flows: keep h alpha_A, and h (1 - alpha_A) times the ratio before the wheel.
        let ln_ratios = problem.ln_inlet_ratios();
        let ln_ratio = mean(&ln_ratios)?;
        let towards_own = other.shared[INLET] - problem.shared[INLET];
        let odds = alpha / (1.0 - alpha) * (-towards_own * ln_ratio).exp();
        other.shared[ALPHA] = odds / (1.0 + odds);
        other.shared[LN_COEFFICIENT] += ((1.0 - alpha) * (1.0 + odds)).ln();
    }
    other.minimise()?;
    Some(other)
}
