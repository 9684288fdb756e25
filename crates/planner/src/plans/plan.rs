//! From a request to a plan.

use crate::jumps::visits::usual_jumps;
use crate::plans::plan_builder::{Draft, PlanBuilder, max_steps};
use crate::plans::plan_figures::rms_error_eta;
use crate::request::{PlanError, PlanRequest};
use crate::targets::reachable;
use mapper_core::{Dwell, Jump, Plan, PlanRemark, Repeats, WindowRule};
use mapper_physics::simulation::steady::SteadyState;

/// Jumps tried for repeats if the request names none; each takes a whole search.
const USUAL_JUMPS: usize = 3;
/// Shortest dwell that is chosen, s: a window begins at [`WindowRule::EARLIEST_S`] at the earliest, and lasts at least as long.
const SHORTEST_DWELL_S: f64 = 2.0 * WindowRule::EARLIEST_S;
/// Longest dwell that is chosen, s: from five minutes on, conventional mapping would do (Burke et al.: 5 to 15 minutes a point).
const LONGEST_DWELL_S: f64 = 300.0;
/// Dwell at which a search for another begins, s: about a time constant of the housing.
const FIRST_DWELL_S: f64 = 40.0;
/// Forecasts that are made to find a dwell: with the power law between the last two, four to six find it to the second.
const ROUNDS: usize = 8;

/// Orders the points and forecasts every step.
///
/// # Errors
/// [`PlanError`] with all unreachable points, all limits in their way, or the step whose forecast failed.
pub fn make_plan(request: &PlanRequest<'_>) -> Result<Plan, PlanError> {
    if request.points.is_empty() {
        return Err(PlanError::NoPoints);
    }
    let targets = reachable(request, request.points)?;
    let made = with_repeats(request, &targets);
    let (true, Err(PlanError::NoAdmissibleOrder(_))) = (request.return_to_first, &made) else { return made };
    // It may be the way back alone that is not allowed: it was not requested by name.
    let mut plan = with_repeats(&PlanRequest { return_to_first: false, ..request.clone() }, &targets)?;
    plan.remarks.push(PlanRemark::NoWayBack);
    Ok(plan)
}

/// The plan with the repeats that the request asks for. `targets`: the steady states of its points.
fn with_repeats(request: &PlanRequest<'_>, targets: &[SteadyState]) -> Result<Plan, PlanError> {
    let Some(repeats) = request.repeats else { return with_jump(request, targets, None) };
    if let Some(jump) = repeats.jump {
        return with_jump(request, targets, Some((repeats, jump)));
    }
    let mut barred = None;
    for jump in usual_jumps(request, targets)?.into_iter().take(USUAL_JUMPS) {
        match with_jump(request, targets, Some((repeats, jump))) {
            // It may be the repeated jump itself that is not allowed from where the machine comes to it.
            Err(error @ PlanError::NoAdmissibleOrder(_)) => barred = Some(error),
            made => return made,
        }
    }
    let mut plan = with_jump(request, targets, None).map_err(|error| barred.unwrap_or(error))?;
    plan.remarks.push(PlanRemark::NoRepeatedJump);
    Ok(plan)
}

/// The plan with one jump repeated, or none.
fn with_jump(
    request: &PlanRequest<'_>,
    targets: &[SteadyState],
    repeats: Option<(Repeats, Jump)>,
) -> Result<Plan, PlanError> {
    let builder = PlanBuilder::of(request, targets, repeats)?;
    let draft = match request.timing.dwell {
        Dwell::Fixed(dwell_s) => builder.draft(dwell_s)?,
        Dwell::TimeBudget(budget_s) => within_budget(request, &builder, budget_s)?,
        Dwell::RequiredSigmaEta(sigma_eta) => reaching(&builder, sigma_eta)?,
    };
    builder.plan(draft)
}

/// The plan with the longest dwell, in whole seconds, that fits the time budget.
fn within_budget(
    request: &PlanRequest<'_>,
    builder: &PlanBuilder<'_>,
    budget_s: f64,
) -> Result<Draft, PlanError> {
    let steps_s = budget_s - request.timing.warm_up_s - request.timing.cool_down_s;
    let dwell_s = |steps: usize| (steps_s / steps as f64).floor();
    let steps = max_steps(request);
    if dwell_s(steps) < SHORTEST_DWELL_S {
        return Err(PlanError::BudgetTooShort {
            budget_s,
            steps,
            dwell_s: dwell_s(steps).max(0.0),
            shortest_s: SHORTEST_DWELL_S,
            needed_s: budget_s - steps_s + steps as f64 * SHORTEST_DWELL_S,
        });
    }
    let draft = builder.draft(dwell_s(steps))?;
    // Where the order passes by the start of the repeated jump, a repeat takes one step instead of two.
    let longer_s = dwell_s(draft.steps().len());
    if longer_s > draft.dwell_s { builder.with_dwell(draft, longer_s) } else { Ok(draft) }
}

/// The plan with the shortest dwell, in whole seconds, whose expected error (rms over the points) is at most `required`; with the
/// longest dwell if none reaches it.
fn reaching(builder: &PlanBuilder<'_>, required: f64) -> Result<Draft, PlanError> {
    // Steps that give too little information for an expected error miss it.
    let error_of = |draft: &Draft| match rms_error_eta(draft.steps()) {
        None if draft.is_predicted() => Ok(f64::INFINITY),
        error => error.ok_or(PlanError::NoPredictedError),
    };
    let mut draft = builder.draft(FIRST_DWELL_S)?;
    // Dwell and error of the longest one that misses, and of the shortest one that reaches.
    let mut misses: Option<(f64, f64)> = None;
    let mut reaches: Option<(f64, f64)> = None;
    for _ in 0..ROUNDS {
        let (dwell_s, error) = (draft.dwell_s, error_of(&draft)?);
        if error <= required {
            reaches = Some((dwell_s, error))
        } else {
            misses = Some((dwell_s, error))
        }
        // Between two dwells the error is nearly a power of the dwell; beyond them it falls as noise averages, with the square root.
        let power = match (misses, reaches) {
            (Some(low), Some(high)) if low.1.is_finite() => (high.1 / low.1).ln() / (high.0 / low.0).ln(),
            _ => -0.5,
        };
        let next_s = match (misses, reaches) {
            (Some(low), Some(high)) if low.1.is_infinite() => (low.0 * high.0).sqrt().ceil(),
            _ if error.is_infinite() => 2.0 * dwell_s,
            // Offsets and gains do not average: an error near them hardly falls.
            (Some(_), None) => (dwell_s * (required / error).powf(1.0 / power)).max(1.5 * dwell_s).ceil(),
            _ => (dwell_s * (required / error).powf(1.0 / power)).ceil(),
        };
        let low_s = misses.map_or(SHORTEST_DWELL_S, |(dwell_s, _)| dwell_s + 1.0);
        let high_s = reaches.map_or(LONGEST_DWELL_S, |(dwell_s, _)| dwell_s - 1.0);
        if low_s > high_s {
            break;
        }
        draft = builder.with_dwell(draft, next_s.clamp(low_s, high_s))?;
    }
    let dwell_s = reaches.map_or(LONGEST_DWELL_S, |(dwell_s, _)| dwell_s);
    // The best order for the dwell that was found, if it reaches the error too.
    let sought = builder.draft(dwell_s)?;
    if reaches.is_none() || error_of(&sought)? <= required {
        Ok(sought)
    } else {
        builder.with_dwell(draft, dwell_s)
    }
}
