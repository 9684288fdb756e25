//! Decides whether h before the wheel equals h after it or follows the law at the inlet's own diameter.
//!
//! Both models have the same parameters and predict nearly the same T2. A recording determines `h alpha_A` before the wheel and `h (1 -
//! alpha_A)` after it. Another h before the wheel therefore changes alpha_A and h, but not the efficiencies. The ratio of the two laws varies
//! by a few percent over a map, with the gas temperature after the wheel, and a recording can distinguish the laws only by this variation. A
//! map steeper than the fitted surface has favoured the wrong model by odds of hundreds to one. So both models are fitted and compared under
//! the roughness of any map. If alpha_A is fixed as declared, the models differ by some hundredths of it. Small model errors can cause the
//! same change, so such a recording does not distinguish the models. The undecided difference becomes an error of every dependent quantity.

use crate::faults::smooth::ANY_ROUGHNESS;
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::step_model::parameters::{ALPHA, INLET, LN_COEFFICIENT, Prior};
use mapper_core::{IdentifiedInlet, InletConvection, Origin};
use mapper_inference::interval::COVERAGE;
use mapper_numerics::statistics::{HINT_SIGMAS, mean};
use nalgebra::DMatrix;

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
pub(crate) fn settle(problem: &mut Problem<'_>) -> Option<Option<f64>> {
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
