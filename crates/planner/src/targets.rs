//! Steady states of the points of a plan, or all that cannot be measured.

use crate::request::{PlanError, PlanRequest, UnreachablePoint};
use mapper_core::OperatingPoint;
use mapper_physics::operating_point::reach::{clause, reach};
use mapper_physics::simulation::steady::SteadyState;

/// Steady states of `points`, or all that cannot be measured, each with all limits in its way.
pub(crate) fn reachable(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
) -> Result<Vec<SteadyState>, PlanError> {
    let mut unreachable = Vec::new();
    let mut targets = Vec::with_capacity(points.len());
    for &point in points {
        match reach(request.model, point, &request.boundary, request.follow_outlet, &request.limits) {
            Ok(target) => targets.push(target),
            Err(obstacles) => unreachable.push(UnreachablePoint { point, reason: clause(&obstacles) }),
        }
    }
    if unreachable.is_empty() { Ok(targets) } else { Err(PlanError::Unreachable(unreachable)) }
}
