//! Whether h before the wheel is that after it or follows the inlet's own diameter.
//!
//! Both readings have the same numbers to find, and nearly the same T2: a recording sees `h alpha_A` before the wheel and
//! `h (1 - alpha_A)` behind it, so with another h before it alpha_A and h come out otherwise, and the efficiencies do not.
//! The ratio of the two laws varies by a few percent over a map (with the gas temperature behind the wheel), which is all
//! that a recording can tell them by, unless alpha_A is held as declared. Then the readings differ by some hundredths of alpha_A,
//! for which small faults of the model pass as well: a map that drops more steeply than the surface that is fitted was seen
//! to speak for the wrong one by odds of hundreds to one. So both are fitted and weighed, such faults
//! counted in; where the recording does not decide, the difference is carried on as an error of everything that it moves.

use crate::joint::parameters::{ALPHA, INLET, LN_COEFFICIENT, PROBE_MM2, Prior};
use crate::joint::solve::{Covariance, FULLY, Problem};
use mapper_core::{FoundInlet, InletConvection, Origin};
use nalgebra::DMatrix;

/// Standard errors of alpha_A below which the readings differ by less than what is left open of it anyway.
const AT_WORK_SIGMAS: f64 = 2.0;
/// What small errors of the model can pass for, as a change of alpha_A: a clearance that grows by a percent as the housing warms up by 100 K
/// looks like 0.06.
const PASSES_FOR_ALPHA: f64 = 0.025;
/// Least spread of the points about the surface of efficiencies, fraction, where the readings are compared: a true map that drops more
/// steeply than the surface speaks for the wrong one. The surface misses the
/// nominal map by as much at eighteen points without noise (`tests/inlet.rs`).
const MIN_SURFACE_SIGMA: f64 = 3e-3;
/// Probability of the other reading below which the recording has decided.
const DECIDED: f64 = 0.05;
/// Share of the distance between the readings that is one standard deviation at least where it has not: the 95 % interval
/// then reaches from one to the other and a quarter beyond, for what noise adds to the other.
const OPEN_SIGMA: f64 = 0.65;

/// Beyond this the straight line says nothing of the distance, and so neither does its ratio to it.
const LARGEST_STRETCH: f64 = 2.0;

/// How far h before the wheel follows the inlet's own law.
pub(crate) fn power_of(convection: InletConvection) -> f64 {
    match convection {
        InletConvection::Shared => 0.0,
        InletConvection::Own => 1.0,
    }
}

fn convection_of(power: f64) -> InletConvection {
    if power == 0.0 { InletConvection::Shared } else { InletConvection::Own }
}

/// Compares both readings on a problem that is at its minimum, and takes the other one where the recording decides for it. Gives what they
/// leave open, one standard deviation of the power; `None` where it makes no difference.
pub(crate) fn settle(problem: &mut Problem<'_>) -> Option<Option<f64>> {
    let error = problem.covariance()?.error_of(ALPHA).unwrap_or(0.0);
    if problem.shared[ALPHA] <= AT_WORK_SIGMAS * error {
        return Some(None);
    }
    let tight = problem.surface_sigma;
    let moved_to = |problem: &mut Problem<'_>, surface_sigma: f64| {
        problem.surface_sigma = surface_sigma;
        problem.active[PROBE_MM2] = problem.probe_fitted;
        problem.minimise(FULLY)
    };
    if tight < MIN_SURFACE_SIGMA {
        moved_to(problem, MIN_SURFACE_SIGMA)?;
    }
    let left_open = compared(problem)?;
    moved_to(problem, tight)?;
    Some(left_open)
}

fn compared(problem: &mut Problem<'_>) -> Option<Option<f64>> {
    let declared = FoundInlet {
        convection: convection_of(problem.shared[INLET]),
        diameter_m: problem.setting.inlet_diameter_m,
        origin: Origin::Assumed,
        probability: 1.0,
        alpha_area_otherwise_ratio: None,
    };
    problem.inlet = Some(declared);
    let Some(mut other) = problem.inlet_sought.then(|| otherwise(problem)).flatten() else {
        return Some(None);
    };
    let seen = 0.5 * (problem.square() - other.square()) * share_of_noise(problem)?;
    let mut left = 1.0 / (1.0 + (-seen).exp());
    // The declared reading stands unless the recording decides against it: where it does not, the other one has other efficiencies.
    if left > 1.0 - DECIDED {
        std::mem::swap(problem, &mut other);
        left = 1.0 - left;
    }
    let decided = left < DECIDED;
    problem.inlet = Some(FoundInlet {
        convection: convection_of(problem.shared[INLET]),
        origin: if decided { Origin::Fitted } else { Origin::NotIdentifiable },
        probability: 1.0 - left,
        alpha_area_otherwise_ratio: problem.active[ALPHA].then_some(other.shared[ALPHA]),
        ..declared
    });
    let sigma = if decided { left.sqrt() } else { left.sqrt().max(OPEN_SIGMA) };
    problem.priors[INLET] = Prior { mean: problem.shared[INLET], sigma };
    problem.active[INLET] = true;
    let stretched = sigma * stretch(problem, &other, &problem.covariance()?);
    problem.active[INLET] = false;
    Some(Some(stretched))
}

/// Carries what the readings leave open into the covariance: by how much everything moves from one towards the other.
pub(crate) fn carry(problem: &mut Problem<'_>, sigma: f64, without: &Covariance) -> Option<Covariance> {
    problem.priors[INLET].sigma = sigma;
    problem.active[INLET] = true;
    let mut with = problem.covariance()?;
    let own = with.row_of(INLET)?;
    let moved = with.shared.column(own) / sigma;
    let place = |row: usize| if row < own { Some(row) } else { row.checked_sub(1).filter(|_| row > own) };
    with.shared = DMatrix::from_fn(moved.len(), moved.len(), |a, b| {
        let known = place(a).zip(place(b)).map_or(0.0, |(a, b)| without.shared[(a, b)]);
        known + moved[a] * moved[b]
    });
    for (i, answer) in with.answers.iter().enumerate() {
        let (own_before, mixed_before) = &without.own[i];
        let alone = own_before - mixed_before * without.answers[i].transpose();
        let mixed = answer * &with.shared;
        with.own[i] = (alone + &mixed * answer.transpose(), mixed);
    }
    Some(with)
}

/// By how much less the readings are told apart than noise alone says: its share of the variance, noise and faults of the model, of a
/// power between 0 and 1 by which h before the wheel follows its own law. 1 where alpha_A is fitted and takes up such faults.
fn share_of_noise(problem: &Problem<'_>) -> Option<f64> {
    if problem.active[ALPHA] {
        return Some(1.0);
    }
    let by_noise = problem.information(INLET)?.powf(-0.5);
    let alpha = problem.shared[ALPHA];
    let ln_ratios = problem.ln_inlet_ratios();
    let ln_ratio = mapper_numerics::statistics::mean(&ln_ratios)?;
    // The change of alpha_A that passes for the whole way from one reading to the other.
    let way = (alpha * (1.0 - alpha) * ln_ratio).abs();
    let by_faults = PASSES_FOR_ALPHA / way;
    let share = (by_noise / by_noise.hypot(by_faults)).powi(2);
    share.is_finite().then_some(share)
}

/// How much farther apart the two fits are than the straight line from one towards the other says: alpha_A and the level of
/// h answer to each other's product, which bends.
fn stretch(problem: &Problem<'_>, other: &Problem<'_>, covariance: &Covariance) -> f64 {
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
        .min(LARGEST_STRETCH)
}

/// The problem at its minimum with the other reading; `None` where it comes to none.
fn otherwise<'a>(problem: &Problem<'a>) -> Option<Problem<'a>> {
    let mut other = problem.clone();
    other.shared[INLET] = 1.0 - problem.shared[INLET];
    let alpha = problem.shared[ALPHA];
    if problem.active[ALPHA] && alpha > 0.0 && alpha < 1.0 {
        // Where both give the same heats: h alpha_A and h (1 - alpha_A) times the ratio before the wheel stay.
        let ln_ratios = problem.ln_inlet_ratios();
        let ln_ratio = mapper_numerics::statistics::mean(&ln_ratios)?;
        let towards_own = other.shared[INLET] - problem.shared[INLET];
        let odds = alpha / (1.0 - alpha) * (-towards_own * ln_ratio).exp();
        other.shared[ALPHA] = odds / (1.0 + odds);
        other.shared[LN_COEFFICIENT] += ((1.0 - alpha) * (1.0 + odds)).ln();
    }
    // The probe says nothing of the inlet; one that rests on its bound in one fit alone would.
    other.active[PROBE_MM2] = false;
    other.minimise(FULLY)?;
    other.active[PROBE_MM2] = problem.active[PROBE_MM2];
    Some(other)
}
