//! The definition of a reachable operating point that campaign, plan and sequence share.
//!
//! **Definition.** A point can be reached if the nominal machine has a steady state at it that violates no limit of the
//! campaign. Its surge margin is [`SteadyState::surge_margin_ratio`]; if no minimum is declared, the limit is the
//! nominal map's surge line.

use crate::machine::params::BoundaryConditions;
use crate::operating_point::follow_outlet::{FollowOutlet, hold_speed};
use crate::simulation::model::Model;
use crate::simulation::steady::{SteadyError, SteadyState};
use mapper_core::{Limits, OperatingPoint, temperature};

/// A reason why a point cannot be reached; its text continues a sentence that starts with the point's name.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Obstacle {
    #[error("is outside the valve's range, above 0 to {highest_ratio}")]
    Opening { highest_ratio: f64 },
    #[error("cannot be held: {0}")]
    NoSteadyState(#[source] SteadyError),
    #[error("is above the speed limit, `limits.speed` = {} krpm", .limit_rpm / 1e3)]
    Speed { limit_rpm: f64 },
    #[error(
        "is beyond the surge line of the nominal map, at {:.0} % of the surge flow", 100.0 * (1.0 + .margin_ratio)
    )]
    Surge { margin_ratio: f64 },
    #[error(
        "has a surge margin of {:.1} %, below `limits.surge_margin` = {} %", 100.0 * .margin_ratio, 100.0 * .limit_ratio
    )]
    SurgeMargin { margin_ratio: f64, limit_ratio: f64 },
    #[error(
        "needs P3 = {:.1} kPa, above `limits.turbine_inlet_pressure.max` = {} kPa", .p3_pa / 1e3, .limit_pa / 1e3
    )]
    HighP3 { p3_pa: f64, limit_pa: f64 },
    #[error(
        "needs P3 = {:.1} kPa, below `limits.turbine_inlet_pressure.min` = {} kPa", .p3_pa / 1e3, .limit_pa / 1e3
    )]
    LowP3 { p3_pa: f64, limit_pa: f64 },
    #[error(
        "heats the compressor outlet to T2 = {}, above `limits.compressor_outlet_temperature` = {}",
        temperature(*.t2_k), temperature(*.limit_k)
    )]
    T2 { t2_k: f64, limit_k: f64 },
    #[error(
        "has T3 = {}, above `limits.turbine_inlet_temperature` = {}", temperature(*.t3_k), temperature(*.limit_k)
    )]
    T3 { t3_k: f64, limit_k: f64 },
}

impl Obstacle {
    /// Key of the limit below `limits`; `None` for an obstacle of the machine or the valve.
    pub fn limit(&self) -> Option<&'static [&'static str]> {
        match self {
            Obstacle::Opening { .. } | Obstacle::NoSteadyState(_) | Obstacle::Surge { .. } => None,
            Obstacle::Speed { .. } => Some(&["speed"]),
            Obstacle::SurgeMargin { .. } => Some(&["surge_margin"]),
            Obstacle::HighP3 { .. } => Some(&["turbine_inlet_pressure", "max"]),
            Obstacle::LowP3 { .. } => Some(&["turbine_inlet_pressure", "min"]),
            Obstacle::T2 { .. } => Some(&["compressor_outlet_temperature"]),
            Obstacle::T3 { .. } => Some(&["turbine_inlet_temperature"]),
        }
    }

    /// The remedy.
    pub fn remedy(&self) -> &'static str {
        match self {
            Obstacle::Opening { .. } => "choose an opening within the range",
            Obstacle::NoSteadyState(_) => "remove the point, or change speed or opening",
            Obstacle::Speed { .. } => {
                "choose a lower speed, or raise the limit if the machine allows it; the limits apply to scripts too"
            }
            Obstacle::Surge { .. } => "remove the point, or open the valve further",
            Obstacle::SurgeMargin { .. } => {
                "remove the point, open the valve further, or lower the limit if the rig allows it"
            }
            Obstacle::HighP3 { .. } | Obstacle::LowP3 { .. } => {
                "remove the point, change it, or widen the limit if the rig allows it"
            }
            Obstacle::T2 { .. } => "remove the point, change it, or raise the limit if the machine allows it",
            Obstacle::T3 { .. } => "lower `boundary.turbine_inlet_temperature`, or raise the limit",
        }
    }
}

/// Solves the steady state of the nominal machine at `point`, whose valve opening replaces that of `boundary`.
///
/// # Errors
/// All reasons why the point cannot be reached, at least one.
pub fn reach(
    model: &Model,
    point: OperatingPoint,
    boundary: &BoundaryConditions,
    follow: FollowOutlet,
    limits: &Limits,
) -> Result<SteadyState, Vec<Obstacle>> {
    let highest_ratio = OperatingPoint::OPENING_MAX_RATIO;
    if !(point.valve_opening_ratio > 0.0 && point.valve_opening_ratio <= highest_ratio) {
        return Err(vec![Obstacle::Opening { highest_ratio }]);
    }
    let mut obstacles = Vec::new();
    if point.speed_rpm > limits.speed_max_rpm {
        obstacles.push(Obstacle::Speed { limit_rpm: limits.speed_max_rpm });
    }
    let boundary = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..*boundary };
    match hold_speed(model, point.speed_rpm, &boundary, follow) {
        Ok(steady) => {
            obstacles.extend(find_violations(model, &steady, limits));
            if obstacles.is_empty() { Ok(steady) } else { Err(obstacles) }
        }
        Err(error) => {
            obstacles.push(Obstacle::NoSteadyState(error));
            Err(obstacles)
        }
    }
}

fn find_violations(model: &Model, steady: &SteadyState, limits: &Limits) -> Vec<Obstacle> {
    let mut violations = Vec::new();
    let margin_ratio = steady.surge_margin_ratio(model);
    match limits.surge_margin_min_ratio {
        Some(limit_ratio) if margin_ratio < limit_ratio => {
            violations.push(Obstacle::SurgeMargin { margin_ratio, limit_ratio });
        }
        None if margin_ratio < limits.surge_margin_floor_ratio() => {
            violations.push(Obstacle::Surge { margin_ratio });
        }
        _ => {}
    }
    let p3_pa = steady.boundary.p3_pa;
    if p3_pa > limits.p3_max_pa {
        violations.push(Obstacle::HighP3 { p3_pa, limit_pa: limits.p3_max_pa });
    } else if p3_pa < limits.p3_min_pa {
        violations.push(Obstacle::LowP3 { p3_pa, limit_pa: limits.p3_min_pa });
    }
    let (t2_k, t3_k) = (steady.outputs.t2_k, steady.boundary.t3_k);
    let t2 = limits.t2_max_k.filter(|limit_k| t2_k > *limit_k);
    violations.extend(t2.map(|limit_k| Obstacle::T2 { t2_k, limit_k }));
    let t3 = limits.t3_max_k.filter(|limit_k| t3_k > *limit_k);
    violations.extend(t3.map(|limit_k| Obstacle::T3 { t3_k, limit_k }));
    violations
}

/// Joins all reasons to one clause that follows the name of a point.
pub fn describe_obstacles(obstacles: &[Obstacle]) -> String {
    obstacles.iter().map(ToString::to_string).collect::<Vec<_>>().join(", and ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        speed_max_rpm: 180e3,
        p3_min_pa: 110e3,
        p3_max_pa: 500e3,
        p3_stroke_s: None,
        t3_max_k: None,
        t2_max_k: None,
        surge_margin_min_ratio: None,
        housing_gradient_max_k: None,
    };

    fn at(speed_rpm: f64, valve_opening_ratio: f64, limits: &Limits) -> Result<SteadyState, Vec<Obstacle>> {
        let point = OperatingPoint { speed_rpm, valve_opening_ratio };
        reach(&Model::nominal(), point, &BoundaryConditions::default(), FollowOutlet::default(), limits)
    }

    #[test]
    fn each_limit_is_in_the_way_by_itself() {
        let steady = at(110e3, 0.7, &LIMITS).unwrap();
        let (p3_pa, t2_k, t3_k) = (steady.boundary.p3_pa, steady.outputs.t2_k, steady.boundary.t3_k);
        let margin_ratio = steady.surge_margin_ratio(&Model::nominal());
        let table = [
            Limits { speed_max_rpm: 109e3, ..LIMITS },
            Limits { p3_max_pa: p3_pa - 1.0, ..LIMITS },
            Limits { p3_min_pa: p3_pa + 1.0, ..LIMITS },
            Limits { t2_max_k: Some(t2_k - 0.1), ..LIMITS },
            Limits { t3_max_k: Some(t3_k - 0.1), ..LIMITS },
            Limits { surge_margin_min_ratio: Some(margin_ratio + 1e-3), ..LIMITS },
        ];
        for limits in table {
            let obstacles = at(110e3, 0.7, &limits).unwrap_err();
            assert_eq!(obstacles.len(), 1, "{obstacles:?}");
        }
        let at_the_limits = Limits {
            speed_max_rpm: 110e3,
            p3_max_pa: p3_pa,
            t2_max_k: Some(t2_k),
            t3_max_k: Some(t3_k),
            surge_margin_min_ratio: Some(margin_ratio),
            ..LIMITS
        };
        assert!(at(110e3, 0.7, &at_the_limits).is_ok(), "a limit itself is allowed");
        assert!(matches!(at(110e3, 2.6, &LIMITS).unwrap_err()[..], [Obstacle::Opening { .. }]));
    }

    #[test]
    fn without_a_declared_margin_the_surge_line_is_the_limit() {
        let obstacles = at(150e3, 0.15, &LIMITS).unwrap_err();
        assert!(obstacles.iter().any(|obstacle| matches!(obstacle, Obstacle::Surge { .. })), "{obstacles:?}");
        let lenient = Limits { surge_margin_min_ratio: Some(-1.0), ..LIMITS };
        let surge =
            |obstacle: &Obstacle| matches!(obstacle, Obstacle::Surge { .. } | Obstacle::SurgeMargin { .. });
        assert!(!at(150e3, 0.15, &lenient).is_err_and(|obstacles| obstacles.iter().any(surge)));
    }
}
