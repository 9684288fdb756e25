//! The plan of a campaign.

use crate::SessionError;
use crate::certainty::{DwellPrices, retimed};
use crate::planning::with_plan_request;
use crate::replanned::reordering;
use crate::surge::count_surge_search;
use crate::thought::Question;
use crate::zero_forecast;
use mapper_campaign::Campaign;
use mapper_core::{Plan, VisitOrder};
use mapper_numerics::parallel;
use mapper_physics::model::Model;
use mapper_planner::{
    Comparison, Now, PlanError, PlanRequest, after_step, before_first_step, best, clearly_cheaper, compare,
    cost_of_reaching, make_plan, with_dwells, without_share,
};
use std::ops::RangeInclusive;

/// Most steps of a plan that is ordered again: that goes through all of them several times.
const MOST_STEPS: usize = 400;
/// Where the search for an order by what steps tell begins: what is added to the seed, and the share of the gradients that the first order
/// keeps. On turbo_a, twelve seeds, one start gives 53 to 74 minutes of steps, 64 in the mean, these three 51 to 63 and 57, six 51 to 60
/// and 56.
const STARTS: [(u64, Option<f64>); 3] = [(0, None), (1, None), (0, Some(0.75))];
/// Numbers of points for which that is done. Of fewer points one start finds an order within 4 % of theirs, and a plan takes no second; of
/// many, plans differ by a few percent and take seconds.
const FROM_ALL_STARTS: RangeInclusive<usize> = 24..=64;
/// What another order has to save of the time, to be taken.
const SAVES_RATIO: f64 = 0.005;

/// The plan of a campaign with a grid, with what seeking surge behind it takes.
///
/// # Errors
/// [`SessionError::Plan`] where points cannot be reached or no order is allowed.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    with_plan_request(campaign, model, |request| plan_of(campaign, request))
}

/// The same of a request that was made from the campaign.
///
/// # Errors
/// As [`plan`].
pub fn plan_of(campaign: &Campaign, request: &PlanRequest<'_>) -> Result<Plan, SessionError> {
    let mut plan = priced(campaign, request)?;
    plan.remarks.extend(beaten(campaign, request, &plan));
    plan.remarks.extend(zero_forecast::sentence(campaign));
    count_surge_search(campaign, request.model, &mut plan);
    Ok(plan)
}

/// The plan beside conventional mapping and all other orders, each made as the plan itself is.
///
/// # Errors
/// As [`plan`].
pub fn compared(
    campaign: &Campaign,
    request: &PlanRequest<'_>,
    plan: &Plan,
) -> Result<Comparison, SessionError> {
    compare(request, plan, |request| priced(campaign, request))
}

/// The plan with dwells by price, and its order sought again for these.
fn priced(campaign: &Campaign, request: &PlanRequest<'_>) -> Result<Plan, SessionError> {
    if request.order == VisitOrder::Best && request.method.is_some() {
        return best(request, |request| priced(campaign, request));
    }
    let is_joint = request.method.is_some_and(|method| method.is_joint());
    if !is_joint || request.required_sigma_eta.is_none() {
        return Ok(make_plan(request)?);
    }
    let plan = priced_openly(campaign, request)?;
    let dwells_s: Vec<f64> = plan.steps.iter().map(|step| step.dwell_s).collect();
    Ok(with_dwells(request, &plan, &dwells_s, true)?.plan)
}

/// The same with open errors alone, by which plans are held against each other. Order and dwells found together settle in one of many
/// valleys, so that an order by what steps tell starts from several places and the cheapest end is taken.
fn priced_openly(campaign: &Campaign, request: &PlanRequest<'_>) -> Result<Plan, SessionError> {
    let is_sought = request.order.needs_method() && request.gradient_share.is_none();
    if !is_sought || !FROM_ALL_STARTS.contains(&request.points.len()) {
        return priced_from(campaign, request, is_sought);
    }
    let cost = |plan: &Plan| cost_of_reaching(plan, request.required_sigma_eta.unwrap_or(0.0));
    let made = parallel::map(&STARTS, |(other_seed, gradient_share)| {
        let seed = request.seed.wrapping_add(*other_seed);
        priced_from(campaign, &PlanRequest { seed, gradient_share: *gradient_share, ..request.clone() }, true)
    });
    let mut cheapest: Result<Plan, SessionError> = Err(PlanError::NoPoints.into());
    for made in made {
        cheapest = match (cheapest, made) {
            (Ok(before), Ok(plan)) if cost(&plan) >= cost(&before) => Ok(before),
            (Ok(before), Err(_)) => Ok(before),
            (_, made) => made,
        };
    }
    Ok(without_share(Plan { seed: request.seed, ..cheapest? }))
}

/// The plan with dwells by price from one start; `sought`: whether its order may be sought again for these.
fn priced_from(campaign: &Campaign, request: &PlanRequest<'_>, sought: bool) -> Result<Plan, SessionError> {
    let draft = make_plan(&PlanRequest { draft: true, ..request.clone() })?;
    let plan = retimed(campaign, request, draft)?;
    if !sought || request.appended.is_some() || plan.steps.len() > MOST_STEPS {
        return Ok(plan);
    }
    // Once: about the plan that this gives, nothing better was found on any campaign that was tried.
    let other = reordered(campaign, request, &plan)?;
    Ok(other.filter(|other| clearly_cheaper(other, &plan, 1.0 - SAVES_RATIO)).unwrap_or(plan))
}

/// The plan in another order, by what each step is worth with the dwell that it has; `None` where none was found.
fn reordered(
    campaign: &Campaign,
    request: &PlanRequest<'_>,
    plan: &Plan,
) -> Result<Option<Plan>, SessionError> {
    let Some((required, (first, rest))) = request.required_sigma_eta.zip(plan.steps.split_first()) else {
        return Ok(None);
    };
    let Some(prices) = DwellPrices::about(campaign, request, plan, Some(required))? else { return Ok(None) };
    let start = before_first_step(request, first, plan.warm_up_s)?;
    let state = after_step(request, start, first, first.dwell_s)?;
    let next_s = first.start_s + first.dwell_s;
    let question = Question {
        request: request.clone(),
        reordering: &reordering(request, plan, &prices)?,
        prices,
        now: Now { state, at: first.to, p3_pa: first.p3_pa, next_s },
        steps: rest.to_vec(),
        before: 1,
        behind: 0,
        made_s: 0.0,
        changed: false,
        clearly_ratio: 0.0,
    };
    let Some(thought) = question.answer()? else { return Ok(None) };
    let mut other = plan.clone();
    other.steps.truncate(1);
    other.steps.extend(thought.steps);
    for (index, step) in other.steps.iter_mut().enumerate() {
        step.index = index;
    }
    // Its bound and proof were those of another order.
    Ok(Some(retimed(campaign, request, other)?))
}

/// Says so where another order of the same points is forecast to be the better bargain. A plan that is ordered by errors was
/// sought as that; `--compare` holds it against all others.
fn beaten(campaign: &Campaign, request: &PlanRequest<'_>, plan: &Plan) -> Option<String> {
    let by_errors = request.order.needs_method();
    request.method.filter(|_| !by_errors)?;
    let others = [VisitOrder::Information, VisitOrder::SpeedLines];
    let others = others.into_iter().filter(|order| *order != request.order);
    let mut better: Vec<Plan> = others
        .filter_map(|order| {
            priced_openly(campaign, &PlanRequest { order, appended: None, ..request.clone() }).ok()
        })
        .filter(|other| clearly_cheaper(other, plan, BEATEN_RATIO))
        .collect();
    better.sort_by(|a, b| {
        if clearly_cheaper(a, b, 1.0) { std::cmp::Ordering::Less } else { std::cmp::Ordering::Greater }
    });
    let other = better.first()?;
    let told = |plan: &Plan| {
        let figures = &plan.figures;
        Some(format!("{:.2} points rms in {:.0} min", 100.0 * figures.open_rms_error_eta?, figures.minutes))
    };
    Some(format!(
        "`order: {}` {BETTER}: {}, this order {}; `mapper plan --compare` shows all orders, `order: best` takes the best",
        other.objective,
        told(other)?,
        told(plan)?
    ))
}

/// What is said of another order.
const BETTER: &str = "is forecast to do better";

/// Where the plan says that another order is forecast to do better: what it says.
pub(crate) fn said_to_be_beaten(plan: &Plan) -> Option<&str> {
    plan.remarks.iter().map(String::as_str).find(|remark| remark.contains(BETTER))
}

/// Cost of another plan, over this one's, from which on it is worth a word.
const BEATEN_RATIO: f64 = 0.95;
