//! Plans of the same points in the other orders, for comparison.

use crate::plans::plan::make_plan_of_direct_jumps;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{Dwell, Plan, Timing, VisitOrder};
use mapper_numerics::parallel;

/// Plans the points of `plan` in every other order, with the same dwell. Orders that a limit forbids are omitted.
///
/// Conventional mapping has no repeats and waits at each point until T2 and the housing drift by less than
/// [`STABLE_DRIFT_K_MIN`](crate::STABLE_DRIFT_K_MIN).
///
/// # Errors
/// [`PlanError`] if a simulation fails.
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
            bound: false,
            ..request.clone()
        })
    };
    parallel::map(&others, make)
        .into_iter()
        .filter(|plan| !matches!(plan, Err(PlanError::NoAdmissibleOrder { .. })))
        .collect()
}
