//! The steady state of an operating point, with conditions that follow the outlet, and the limits that it violates.

use crate::machine::params::BoundaryConditions;
use crate::simulation::model::Model;
use crate::simulation::steady;
use crate::simulation::steady::{SteadyError, SteadyState};
use mapper_core::{AvoidedRange, Limits, OperatingPoint, krpm, readable, temperature};
use serde::{Deserialize, Serialize};

/// Temperatures that follow the compressor's outlet temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FollowOutlet {
    /// Turbine inlet total temperature, T3.
    pub turbine_inlet: bool,
    /// Oil inlet temperature.
    pub oil: bool,
}

impl FollowOutlet {
    /// Whether nothing follows.
    pub fn is_off(&self) -> bool {
        !(self.turbine_inlet || self.oil)
    }
}

/// Maximum number of rounds until the temperatures agree; each reduces the difference to a few per cent.
const MAX_ROUNDS: usize = 40;
/// Maximum difference of temperatures after convergence, K.
const TOLERANCE_K: f64 = 1e-6;

/// Like [`steady::hold_speed`], with the temperatures in `follow` at the outlet temperature of that steady state; the others are as
/// in `boundary`.
pub fn hold_speed(
    model: &Model,
    speed_rpm: f64,
    boundary: &BoundaryConditions,
    follow: FollowOutlet,
) -> Result<SteadyState, SteadyError> {
    let mut boundary = *boundary;
    if follow.is_off() {
        return steady::hold_speed(model, speed_rpm, &boundary);
    }
    for _ in 0..MAX_ROUNDS {
        let steady_state = steady::hold_speed(model, speed_rpm, &boundary)?;
        let outlet_k = steady_state.outputs.t2_k;
        let off_k = |follows: bool, value_k: f64| if follows { (outlet_k - value_k).abs() } else { 0.0 };
        if off_k(follow.turbine_inlet, boundary.t3_k).max(off_k(follow.oil, boundary.oil_temperature_k))
            < TOLERANCE_K
        {
            return Ok(steady_state);
        }
        if follow.turbine_inlet {
            boundary.t3_k = outlet_k;
        }
        if follow.oil {
            boundary.oil_temperature_k = outlet_k;
        }
    }
    Err(SteadyError::NoHeatBalance { speed_rpm, valve_opening_ratio: boundary.valve_opening_ratio })
}

/// A reason why a point cannot be reached; its text continues a sentence that starts with the point's name.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Obstacle {
    #[error("is outside the valve's range, above 0 to {highest_ratio}")]
    Opening { highest_ratio: f64 },
    #[error("cannot be held: {0}")]
    NoSteadyState(#[source] SteadyError),
    #[error("is above the speed limit, `limits.speed` = {} krpm", krpm(*.limit_rpm))]
    Speed { limit_rpm: f64 },
    #[error(
        "is within the speeds to avoid, `limits.avoid` from {} to {} krpm; allowed next to them: {}", krpm(.range.from_rpm),
        krpm(.range.to_rpm), .nearest_rpm.iter().map(|rpm| readable(*rpm, "rpm")).collect::<Vec<_>>().join(" and ")
    )]
    Avoided { range: AvoidedRange, nearest_rpm: Vec<f64> },
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
            Obstacle::Avoided { .. } => Some(&["avoid"]),
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
            Obstacle::Avoided { .. } => {
                "choose an allowed speed, or narrow the range if the machine allows it; no step may stay inside"
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

/// Solves the steady state of the nominal machine at `point`, whose valve opening replaces that of `boundary`; or all reasons
/// why it cannot be reached.
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
    if let Some((range, nearest_rpm)) = limits.avoid.at(point.speed_rpm, limits.speed_max_rpm) {
        obstacles.push(Obstacle::Avoided { range, nearest_rpm });
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
    use crate::gas::air::Air;

    /// With T3 and oil at T2 the temperature rise gives the map's own efficiency, except for losses to the cell.
    #[test]
    fn nothing_heats_the_gas_when_all_is_at_its_temperature() {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..BoundaryConditions::default() };
        let follow = FollowOutlet { turbine_inlet: true, oil: true };
        let error = |steady_state: &SteadyState| {
            let outputs = &steady_state.outputs;
            let rise = crate::laws::compression::isentropic_rise_ratio(
                outputs.pressure_ratio,
                boundary.t1_k,
                Air::PAPER,
            );
            (boundary.t1_k * rise / (outputs.t2_k - boundary.t1_k) - outputs.efficiency).abs()
        };
        for speed_rpm in [50e3, 80e3] {
            let steady_state = hold_speed(&model, speed_rpm, &boundary, follow).unwrap();
            assert!((steady_state.boundary.t3_k - steady_state.outputs.t2_k).abs() < 1e-5);
            assert!((steady_state.boundary.oil_temperature_k - steady_state.outputs.t2_k).abs() < 1e-5);
            // The remaining difference is the housings' loss to the cell, some watts.
            assert!(error(&steady_state) < 0.01, "{}", error(&steady_state));
        }
        // At low speed the hot turbine heats the compressor most: several points of efficiency.
        let cold = hold_speed(&model, 50e3, &boundary, follow).unwrap();
        let hot = steady::hold_speed(&model, 50e3, &boundary).unwrap();
        assert!(error(&cold) < 0.25 * error(&hot), "{} {}", error(&cold), error(&hot));
        // Nothing to follow: the same state.
        let plain = hold_speed(&model, 80e3, &boundary, FollowOutlet::default()).unwrap();
        assert_eq!(plain, steady::hold_speed(&model, 80e3, &boundary).unwrap());
    }

    const LIMITS: Limits = Limits {
        speed_max_rpm: 180e3,
        p3_min_pa: 110e3,
        p3_max_pa: 500e3,
        p3_stroke_s: None,
        t3_max_k: None,
        t2_max_k: None,
        surge_margin_min_ratio: None,
        housing_gradient_max_k: None,
        overshoot_max_ratio: None,
        avoid: mapper_core::AvoidedSpeeds::NONE,
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
