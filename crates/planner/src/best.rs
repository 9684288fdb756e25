//! The order that is forecast to know most for the time it takes, and all orders beside it.

use crate::request::{PlanError, PlanRequest};
use mapper_core::{Plan, VisitOrder};
use mapper_numerics::parallel;

/// Orders that are tried.
const ORDERS: [VisitOrder; 5] = [
    VisitOrder::SumGradient,
    VisitOrder::WorstGradient,
    VisitOrder::Information,
    VisitOrder::SpeedLines,
    VisitOrder::Greedy,
];

/// Shares of the largest sum of gradients that orders are made to keep, for the front between gradients and what steps tell.
const SHARES: [f64; 3] = [0.9, 0.75, 0.6];

/// Mean square error of the efficiency times the minutes of the run: what a campaign costs whose errors fall with the time
/// that is spent on it. The error is that where nothing is as declared: no order is worth anything that holds only on the
/// nominal machine. Infinite where no error was forecast.
pub(crate) fn cost(plan: &Plan) -> f64 {
    cost_of(plan.figures.open_rms_error_eta, plan.figures.minutes)
}

/// The same of an error, a fraction, and a time.
pub(crate) fn cost_of(open_rms_error_eta: Option<f64>, minutes: f64) -> f64 {
    open_rms_error_eta.map_or(f64::INFINITY, |rms| rms * rms * minutes)
}

/// The same of a plan that has an error to reach, a fraction: one below it is worth nothing.
pub fn cost_of_reaching(plan: &Plan, required_sigma_eta: f64) -> f64 {
    cost_of(plan.figures.open_rms_error_eta.map(|rms| rms.max(required_sigma_eta)), plan.figures.minutes)
}

/// Whether one plan costs less than so many times the other: mean square error times minutes.
pub fn clearly_cheaper(one: &Plan, other: &Plan, ratio: f64) -> bool {
    cost(one) < ratio * cost(other)
}

/// The plan under each order that allows one, those that keep a share of the gradients among them, the cheapest first; `make` makes
/// one.
pub(crate) fn all<E: Send>(
    request: &PlanRequest<'_>,
    make: impl Fn(&PlanRequest<'_>) -> Result<Plan, E> + Sync,
) -> Result<Vec<Plan>, E> {
    let mut ways: Vec<(VisitOrder, Option<f64>)> = ORDERS.into_iter().map(|order| (order, None)).collect();
    if request.method.is_some_and(|method| method.is_joint()) {
        let asked = request.gradient_share.filter(|share| !SHARES.contains(share));
        ways.extend(SHARES.into_iter().chain(asked).map(|share| (VisitOrder::Information, Some(share))));
    }
    let made = parallel::map(&ways, |(order, gradient_share)| {
        let request = PlanRequest { order: *order, gradient_share: *gradient_share, ..request.clone() };
        let plan = make(&request)?;
        Ok(match gradient_share {
            Some(share) if order.needs_method() => {
                Plan { objective: keeping(&plan.objective, *share), ..plan }
            }
            _ => plan,
        })
    });
    let (mut plans, mut failed) = (Vec::new(), None);
    for made in made {
        match made {
            Ok(plan) => plans.push(plan),
            Err(error) => failed = Some(error),
        }
    }
    plans.sort_by(|a: &Plan, b: &Plan| cost(a).total_cmp(&cost(b)));
    match failed {
        Some(error) if plans.is_empty() => Err(error),
        _ => Ok(plans),
    }
}

/// Name of an order that keeps a share of the gradients.
fn keeping(order: &str, share: f64) -> String {
    format!("{order}, gradients {:.0} %", 1e2 * share)
}

/// The cheapest of them, with what it was chosen from; `make` makes the plan of each order.
///
/// # Errors
/// Those of `make`, where no order allows a plan.
pub fn best<E: From<PlanError> + Send>(
    request: &PlanRequest<'_>,
    make: impl Fn(&PlanRequest<'_>) -> Result<Plan, E> + Sync,
) -> Result<Plan, E> {
    let plans = all(request, make)?;
    let told: Vec<String> = plans.iter().map(told).collect();
    let mut best = plans.into_iter().next().ok_or(PlanError::NoPoints)?;
    best.remarks
        .push(format!("of the orders {}, the first is the best for the time it takes", told.join("; ")));
    best.objective = VisitOrder::Best.name().to_owned();
    Ok(best)
}

fn told(plan: &Plan) -> String {
    let figures = &plan.figures;
    let error = figures.open_rms_error_eta.map_or("-".to_owned(), |rms| format!("{:.2}", 100.0 * rms));
    format!("{} ({error} points rms in {:.0} min)", plan.objective, figures.minutes)
}
