//! From a request to a plan.

use crate::best::{best, cost_of};
use crate::dwell::{FORECASTS, needed_s};
use crate::figures::{duration_s, open_rms_error_eta};
use crate::forecast::MOST_TOGETHER;
use crate::reach::reachable;
use crate::repeats::usual_jumps;
use crate::request::{PlanError, PlanRequest};
use crate::stage::{Made, Sought, Stage};
use mapper_core::{Jump, Plan, Repeats, VisitOrder};
use mapper_numerics::statistics::mean;
use mapper_physics::steady::SteadyState;

/// Effort of a search that only leads to another, over the usual, and the forecasts that it may take.
const ROUGHLY_RATIO: f64 = 0.03;
const ROUGH_FORECASTS: usize = 3;
/// The same of one by what steps are worth: that is known to a few percent only, and thirty times the effort, or what
/// steps are worth worked out again about the order that was found, finds plans that cost some 3 % less (docs/performance.md).
const INFORMED_RATIO: f64 = 0.1;
/// The same where dwells are found by price behind it.
const DRAFTED_RATIO: f64 = 0.03;
const FEW_POINTS: usize = 40;
/// The dwell for which an order is sought then: at most so much of the longest, and so much of what equal steps would need, which
/// priced ones undercut (decision 0048).
const DRAFTED_DWELL_RATIO: f64 = 0.5;
const UNDERCUT_RATIO: f64 = 0.85;
/// Jumps tried for repeats where the request names none.
const USUAL_JUMPS: usize = 3;
/// Orders the points and forecasts every step.
///
/// # Errors
/// [`PlanError`] with all unreachable points, all limits in their way, or the step whose forecast failed.
pub fn make_plan(request: &PlanRequest<'_>) -> Result<Plan, PlanError> {
    if request.points.is_empty() {
        return Err(PlanError::NoPoints);
    }
    if request.order.needs_method() && request.method.is_none() {
        return Err(PlanError::NeedsMethod { order: request.order.name() });
    }
    if request.order == VisitOrder::Time && request.required_sigma_eta.is_none() {
        return Err(PlanError::NeedsRequiredError);
    }
    if request.order == VisitOrder::Best {
        return best(request, make_plan);
    }
    let targets = reachable(request, request.points)?;
    with_or_without_return(request, &targets)
}

/// The plan as asked for, or without the way back where that is what a limit forbids.
fn with_or_without_return(request: &PlanRequest<'_>, targets: &[SteadyState]) -> Result<Plan, PlanError> {
    let made = plan_to(request, targets);
    let (true, Err(PlanError::NoAdmissibleOrder(_))) = (request.return_to_first, &made) else { return made };
    // It may be the way back alone that is not allowed: nobody asked for it by name.
    let mut plan = plan_to(&PlanRequest { return_to_first: false, ..request.clone() }, targets)?;
    plan.remarks.push("a limit forbids the way back to the first point at the end".to_owned());
    Ok(plan)
}

/// The plan with the repeats that the request asks for. `targets`: the steady states of its points.
fn plan_to(request: &PlanRequest<'_>, targets: &[SteadyState]) -> Result<Plan, PlanError> {
    let Some(repeats) = request.repeats else { return plan_with(request, targets, None) };
    if let Some(jump) = repeats.jump {
        return plan_with(request, targets, Some((repeats, jump)));
    }
    let mut barred = None;
    for jump in usual_jumps(request, targets)?.into_iter().take(USUAL_JUMPS) {
        match plan_with(request, targets, Some((repeats, jump))) {
            // It may be the repeated jump itself that is not allowed from where the machine comes to it.
            Err(error @ PlanError::NoAdmissibleOrder(_)) => barred = Some(error),
            made => return made,
        }
    }
    let mut plan = plan_with(request, targets, None).map_err(|error| barred.unwrap_or(error))?;
    plan.remarks.push("no jump between the points can be repeated, so that drift would not show".to_owned());
    Ok(plan)
}

/// The plan with one jump repeated, or none. `reached`: the steady states of the request's points.
fn plan_with(
    request: &PlanRequest<'_>,
    reached: &[SteadyState],
    repeats: Option<(Repeats, Jump)>,
) -> Result<Plan, PlanError> {
    let stage = Stage::of(request, reached, repeats)?;
    let joint = request.method.is_some_and(|method| method.is_joint());
    let longest_s = request.timing.dwell_s;
    let usual = Sought { dwell_s: longest_s, effort: request.effort, forecasts: FORECASTS };
    if !joint {
        return Ok(stage.plan(stage.made(request.order, usual, None)?));
    }
    let informed = request.order.needs_method();
    let first = if informed { VisitOrder::SumGradient } else { request.order };
    let chosen = request.required_sigma_eta.is_some() && first != VisitOrder::Listed;
    if !(informed || chosen) {
        return Ok(stage.plan(stage.made(first, usual, None)?));
    }
    // An order is sought for the dwells that it will have, and what steps are worth is known about a campaign: both come from
    // a rough first one.
    let rough = Sought { effort: ROUGHLY_RATIO * request.effort, forecasts: ROUGH_FORECASTS, ..usual };
    // Of few points an order is sought thoroughly in no time.
    let many = request.points.len() > FEW_POINTS;
    let drafted = informed && request.draft && many && request.required_sigma_eta.is_some();
    let rough = match drafted {
        true => Sought { dwell_s: (DRAFTED_DWELL_RATIO * longest_s).round(), forecasts: 1, ..rough },
        false => rough,
    };
    let mut made = stage.made(first, rough, None)?;
    let dwell_s = |made: &Made| {
        let dwells_s: Vec<f64> = made.steps().iter().map(|step| step.dwell_s).collect();
        mean(&dwells_s).unwrap_or(longest_s).round()
    };
    if let (true, Some(error)) = (drafted, open_rms_error_eta(made.steps())) {
        // Where shorter steps will do, what steps are worth is known about those.
        let needed_s = (UNDERCUT_RATIO * needed_s(request, dwell_s(&made), error)).round();
        if needed_s < dwell_s(&made) {
            made = stage.made(first, Sought { dwell_s: needed_s, ..rough }, None)?;
        }
    }
    if !informed {
        made = stage.made(first, Sought { dwell_s: dwell_s(&made), ..usual }, None)?;
        return Ok(stage.plan(made));
    }
    if let Some(method) = request.method {
        let rows: Vec<_> = made.rows().iter().take(MOST_TOGETHER).map(Vec::as_slice).collect();
        if let Some(worth) = method.worth_to(&rows) {
            let (ratio, forecasts) = if drafted { (DRAFTED_RATIO, 1) } else { (INFORMED_RATIO, FORECASTS) };
            let sought = Sought { dwell_s: dwell_s(&made), effort: ratio * request.effort, forecasts };
            let other = stage.made(request.order, sought, Some(worth.as_ref()))?;
            let cost = |made: &Made| {
                cost_of(open_rms_error_eta(made.steps()), duration_s(request, made.steps()) / 60.0)
            };
            if cost(&other) < cost(&made) {
                made = other;
            }
        }
    }
    let plan = stage.plan(made);
    Ok(Plan { objective: request.order.name().to_owned(), ..plan })
}
