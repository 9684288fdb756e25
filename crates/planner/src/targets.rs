//! Steady states of the points of a plan.

use crate::request::{PlanError, PlanRequest, UnreachablePoint};
use mapper_core::OperatingPoint;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::simulation::steady::SteadyState;

/// Solves the steady state of each point. The error lists every point that violates a limit, with all violated limits.
pub(crate) fn solve_steady_states(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
) -> Result<Vec<SteadyState>, PlanError> {
    let mut unreachable = Vec::new();
    let mut targets = Vec::with_capacity(points.len());
    for &point in points {
        match reach(request.model, point, &request.boundary, request.follow_outlet, &request.limits) {
            Ok(target) => targets.push(target),
            Err(obstacles) => {
                unreachable.push(UnreachablePoint { point, reason: describe_obstacles(&obstacles) })
            }
        }
    }
    if unreachable.is_empty() { Ok(targets) } else { Err(PlanError::Unreachable(unreachable)) }
}
