//! Makes a plan from a request: the repeated jump, the dwell, then the order; and plans of the same points in the other orders.

use crate::plan_builder::{Draft, PlanBuilder, max_steps, rms_error_eta};
use crate::request::{PlanError, PlanRequest, solve_steady_states};
use crate::visits::propose_repeated_jumps;
use mapper_core::{Dwell, Jump, Plan, PlanRemark, Repeats, Timing, VisitOrder, WindowRule};
use mapper_numerics::parallel;
use mapper_physics::simulation::steady::SteadyState;

/// Maximum number of jumps tried for repeats if the request gives none; each needs a complete search.
const MAX_REPEATED_JUMPS_TRIED: usize = 3;
/// Minimum dwell, s: a window begins no earlier than [`WindowRule::EARLIEST_S`] and lasts at least as long.
const MIN_DWELL_S: f64 = 2.0 * WindowRule::EARLIEST_S;
/// Maximum dwell, s: at five minutes a point, conventional mapping is as fast (Burke et al.: 5 to 15 minutes a point).
const MAX_DWELL_S: f64 = 300.0;
/// First dwell in the search for the required dwell, s: about one time constant of the housing.
const FIRST_DWELL_S: f64 = 40.0;
/// Maximum number of forecasts in the search for the required dwell: the power law between the last two needs four to six of them for a
/// resolution of one second.
const MAX_FORECASTS: usize = 8;

/// Orders the points and forecasts every step.
pub fn make_plan(request: &PlanRequest<'_>) -> Result<Plan, PlanError> {
    if request.points.is_empty() {
        return Err(PlanError::NoPoints);
    }
    let targets = solve_steady_states(request, request.points)?;
    match plan_with_return(request, &targets, false) {
        // Every order contains a forbidden jump: lead around it.
        Err(PlanError::NoAdmissibleOrder { .. }) => plan_with_return(request, &targets, true),
        plan => plan,
    }
}

/// Makes the plan of [`make_plan`], but refuses if every order contains a forbidden jump.
fn make_plan_of_direct_jumps(request: &PlanRequest<'_>) -> Result<Plan, PlanError> {
    plan_with_return(request, &solve_steady_states(request, request.points)?, false)
}

/// Makes the plan with the return to the first point if it is requested and allowed. `targets`: the steady states of its points.
fn plan_with_return(
    request: &PlanRequest<'_>,
    targets: &[SteadyState],
    ways_around: bool,
) -> Result<Plan, PlanError> {
    let plan = plan_with_repeats(request, targets, ways_around);
    let (true, Err(PlanError::NoAdmissibleOrder { .. })) = (request.return_to_first, &plan) else {
        return plan;
    };
    // Only the return may be forbidden. It is a default, not a request, so the plan is made without it.
    let without = PlanRequest { return_to_first: false, ..request.clone() };
    let mut plan = plan_with_repeats(&without, targets, ways_around)?;
    plan.remarks.push(PlanRemark::NoWayBack);
    Ok(plan)
}

fn plan_with_repeats(
    request: &PlanRequest<'_>,
    targets: &[SteadyState],
    ways_around: bool,
) -> Result<Plan, PlanError> {
    let plan_with_jump = |repeats| plan_with_jump(request, targets, repeats, ways_around);
    let Some(repeats) = request.repeats else { return plan_with_jump(None) };
    if let Some(jump) = repeats.jump {
        return plan_with_jump(Some((repeats, jump)));
    }
    let mut no_order = None;
    for jump in propose_repeated_jumps(request, targets)?.into_iter().take(MAX_REPEATED_JUMPS_TRIED) {
        match plan_with_jump(Some((repeats, jump))) {
            // The jump may be allowed from a steady state, but not from the housing temperatures of the plan: try the next one.
            Err(error @ PlanError::NoAdmissibleOrder { .. }) => no_order = Some(error),
            result => return result,
        }
    }
    let mut plan = plan_with_jump(None).map_err(|error| no_order.unwrap_or(error))?;
    plan.remarks.push(PlanRemark::NoRepeatedJump);
    Ok(plan)
}

/// Makes the plan with one repeated jump, or with none.
fn plan_with_jump(
    request: &PlanRequest<'_>,
    targets: &[SteadyState],
    repeats: Option<(Repeats, Jump)>,
    ways_around: bool,
) -> Result<Plan, PlanError> {
    let builder = PlanBuilder::new(request, targets, repeats, ways_around)?;
    let draft = match request.timing.dwell {
        Dwell::Fixed(dwell_s) => builder.draft(dwell_s)?,
        Dwell::TimeBudget(budget_s) => fit_time_budget(request, &builder, budget_s)?,
        Dwell::RequiredSigmaEta(sigma_eta) => fit_required_error(&builder, sigma_eta)?,
    };
    builder.plan(draft)
}

/// Finds the longest dwell, in whole seconds, that fits the time budget.
fn fit_time_budget(
    request: &PlanRequest<'_>,
    builder: &PlanBuilder<'_>,
    budget_s: f64,
) -> Result<Draft, PlanError> {
    let steps_s = budget_s - request.timing.warm_up_s - request.timing.cool_down_s;
    let dwell_s = |steps: usize| (steps_s / steps as f64).floor();
    let steps = max_steps(request);
    let too_short = |steps: usize| {
        Err(PlanError::BudgetTooShort {
            budget_s,
            steps,
            dwell_s: dwell_s(steps).max(0.0),
            shortest_s: MIN_DWELL_S,
            needed_s: budget_s - steps_s + steps as f64 * MIN_DWELL_S,
        })
    };
    if dwell_s(steps) < MIN_DWELL_S {
        return too_short(steps);
    }
    let draft = builder.draft(dwell_s(steps))?;
    // A repeat takes one step instead of two if the order visits the start of the repeated jump anyway. Ways around forbidden jumps take
    // more steps.
    let steps = draft.steps().len();
    // On a slow stand, steps are longer by the time in which P3 and valve arrive.
    let arrivals_s: f64 = draft.steps().iter().map(|step| step.dwell_s - draft.dwell_s).sum();
    match ((steps_s - arrivals_s) / steps as f64).floor() {
        fitting_s if fitting_s < MIN_DWELL_S => too_short(steps),
        fitting_s => builder.with_dwell(draft, fitting_s),
    }
}

/// Finds the shortest dwell, in whole seconds, whose expected error (rms over the points) is at most `required`; the maximum dwell if
/// none is sufficient.
fn fit_required_error(builder: &PlanBuilder<'_>, required: f64) -> Result<Draft, PlanError> {
    // Steps with too little information for a predicted error do not reach the required one.
    let error_of = |draft: &Draft| match rms_error_eta(draft.steps()) {
        None if draft.is_predicted() => Ok(f64::INFINITY),
        error => error.ok_or(PlanError::NoPredictedError),
    };
    let mut draft = builder.draft(FIRST_DWELL_S)?;
    // Dwell and error of the longest dwell that is too short, and of the shortest one that is sufficient.
    let mut misses: Option<(f64, f64)> = None;
    let mut reaches: Option<(f64, f64)> = None;
    for _ in 0..MAX_FORECASTS {
        let (dwell_s, error) = (draft.dwell_s, error_of(&draft)?);
        if error <= required {
            reaches = Some((dwell_s, error))
        } else {
            misses = Some((dwell_s, error))
        }
        // Between two dwells the error is nearly a power of the dwell. Beyond them it falls like averaged noise, with the square root.
        let power = match (misses, reaches) {
            (Some(low), Some(high)) if low.1.is_finite() => (high.1 / low.1).ln() / (high.0 / low.0).ln(),
            _ => -0.5,
        };
        let next_s = match (misses, reaches) {
            (Some(low), Some(high)) if low.1.is_infinite() => (low.0 * high.0).sqrt().ceil(),
            _ if error.is_infinite() => 2.0 * dwell_s,
            // Offset and gain errors do not average out, so an error close to them falls slowly: take larger steps.
            (Some(_), None) => (dwell_s * (required / error).powf(1.0 / power)).max(1.5 * dwell_s).ceil(),
            _ => (dwell_s * (required / error).powf(1.0 / power)).ceil(),
        };
        let low_s = misses.map_or(MIN_DWELL_S, |(dwell_s, _)| dwell_s + 1.0);
        let high_s = reaches.map_or(MAX_DWELL_S, |(dwell_s, _)| dwell_s - 1.0);
        if low_s > high_s {
            break;
        }
        draft = builder.with_dwell(draft, next_s.clamp(low_s, high_s))?;
    }
    let dwell_s = reaches.map_or(MAX_DWELL_S, |(dwell_s, _)| dwell_s);
    // Search the order again for the final dwell, and use it if it reaches the error too.
    let reordered = builder.draft(dwell_s)?;
    if reaches.is_none() || error_of(&reordered)? <= required {
        Ok(reordered)
    } else {
        builder.with_dwell(draft, dwell_s)
    }
}

/// Plans the points of `plan` in every other order, with the same dwell. Orders that a limit forbids are omitted.
///
/// Conventional mapping has no repeats and waits at each point until T2 and the housing drift by less than
/// [`STABLE_DRIFT_K_MIN`](crate::STABLE_DRIFT_K_MIN).
pub fn plan_other_orders(request: &PlanRequest<'_>, plan: &Plan) -> Result<Vec<Plan>, PlanError> {
    let others: Vec<VisitOrder> =
        VisitOrder::ALL.into_iter().filter(|order| order.name() != plan.objective).collect();
    let dwell_s = plan.steps.first().map_or(0.0, |step| step.dwell_s);
    let make = |order: &VisitOrder| {
        let conventional = *order == VisitOrder::Conventional;
        let dwell = Dwell::Fixed(if conventional { 0.0 } else { dwell_s });
        make_plan_of_direct_jumps(&PlanRequest {
            order: *order,
            timing: Timing { dwell, ..request.timing },
            repeats: request.repeats.filter(|_| !conventional),
            return_to_first: request.return_to_first && !conventional,
            appended: None,
            ..request.clone()
        })
    };
    parallel::map(&others, make)
        .into_iter()
        .filter(|plan| !matches!(plan, Err(PlanError::NoAdmissibleOrder { .. })))
        .collect()
}
