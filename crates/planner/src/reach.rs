//! Which points can be measured at all: their steady states, held against every limit.

use crate::request::{PlanError, PlanLimits, PlanRequest, UnreachablePoint};
use mapper_core::OperatingPoint;
use mapper_physics::follow_outlet::hold_speed;
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady::SteadyState;

/// Steady states of `points`, or all that cannot be measured, each with all limits in its way.
pub(crate) fn reachable(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
) -> Result<Vec<SteadyState>, PlanError> {
    let mut unreachable = Vec::new();
    let mut targets = Vec::with_capacity(points.len());
    for &point in points {
        let boundary =
            BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..request.boundary };
        match hold_speed(request.model, point.speed_rpm, &boundary, request.follow_outlet) {
            Ok(target) => {
                let reasons = violated_limits(request.model, &request.limits, point, &target);
                if reasons.is_empty() {
                    targets.push(target);
                } else {
                    unreachable.push(UnreachablePoint { point, reason: reasons.join(", and ") });
                }
            }
            Err(error) => unreachable.push(UnreachablePoint { point, reason: error.to_string() }),
        }
    }
    if unreachable.is_empty() { Ok(targets) } else { Err(PlanError::Unreachable(unreachable)) }
}

fn violated_limits(
    model: &Model,
    limits: &PlanLimits,
    point: OperatingPoint,
    target: &SteadyState,
) -> Vec<String> {
    let mut reasons = Vec::new();
    let boundary = &target.boundary;
    if point.speed_rpm > limits.speed_max_rpm {
        reasons.push(format!("above the speed limit of {:.0} rpm", limits.speed_max_rpm));
    }
    if !(limits.p3_min_pa..=limits.p3_max_pa).contains(&boundary.p3_pa) {
        reasons.push(format!(
            "needs P3 = {:.1} kPa, the limits are {:.1} to {:.1} kPa",
            boundary.p3_pa / 1e3,
            limits.p3_min_pa / 1e3,
            limits.p3_max_pa / 1e3
        ));
    }
    let above = |name: &str, value_k: f64, limit_k: Option<f64>| {
        limit_k
            .filter(|limit_k| value_k > *limit_k)
            .map(|limit_k| format!("{name} = {value_k:.1} K is above its limit of {limit_k:.1} K"))
    };
    reasons.extend(above("T2", target.outputs.t2_k, limits.t2_max_k));
    reasons.extend(above("T3", boundary.t3_k, limits.t3_max_k));
    if let Some(smallest) = limits.surge_margin_min_ratio {
        let corrected_rpm = model.map.reference().corrected_speed_rpm(point.speed_rpm, boundary.t1_k);
        let (surge_flow_kg_s, _) = model.map.surge_point(corrected_rpm);
        let margin = target.outputs.flow_corrected_kg_s / surge_flow_kg_s - 1.0;
        if margin < smallest {
            reasons.push(format!(
                "its surge margin of {:.1} % is below the smallest of {:.1} %",
                100.0 * margin,
                100.0 * smallest
            ));
        }
    }
    reasons
}
