//! The transition of a step: the fastest of the candidate ramps that leave no limit of surge margin or speed, and the forecast on them.

use crate::operating_point::forecast::{StepForecast, forecast_step};
use crate::operating_point::transition::{TransitionInputs, candidate_ramps};
use crate::simulation::model::{Model, State};
use crate::simulation::simulate::SimulationError;
use crate::simulation::steady::SteadyState;
use mapper_core::{AvoidedCrossing, Limits, Ramps, RigActuators, Transition, WindowRule};

/// A limit that a transition violates on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TransitionViolation {
    /// The surge margin falls below its limit, ratios.
    SurgeMargin {
        /// Lowest margin.
        lowest_ratio: f64,
        /// Limit.
        limit_ratio: f64,
    },
    /// The shaft exceeds the limit of speed, rpm.
    Overspeed {
        /// Highest speed.
        highest_rpm: f64,
        /// Limit.
        limit_rpm: f64,
    },
    /// The shaft overshoots the higher of the two targets, rpm.
    Overshoot {
        /// Highest speed.
        highest_rpm: f64,
        /// Higher target.
        target_rpm: f64,
        /// Highest allowed speed.
        limit_rpm: f64,
    },
    /// The shaft crosses speeds to avoid too slowly.
    Avoided(AvoidedCrossing),
}

impl TransitionViolation {
    /// What the transition reaches, relative to its limit; above 1.
    pub fn ratio(&self) -> f64 {
        match *self {
            TransitionViolation::SurgeMargin { lowest_ratio, limit_ratio } => {
                surge_excess_ratio(lowest_ratio, limit_ratio)
            }
            TransitionViolation::Overspeed { highest_rpm, limit_rpm }
            | TransitionViolation::Overshoot { highest_rpm, limit_rpm, .. } => highest_rpm / limit_rpm,
            TransitionViolation::Avoided(crossing) => crossing.ratio(),
        }
    }
}

/// The flow at the limit of the surge margin over the lowest flow.
pub fn surge_excess_ratio(lowest_ratio: f64, limit_ratio: f64) -> f64 {
    (1.0 + limit_ratio) / (1.0 + lowest_ratio).max(f64::EPSILON)
}

/// Limits and actuators of the stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand<'a> {
    /// Limits.
    pub limits: &'a Limits,
    /// Motion of the actuators.
    pub actuators: &'a RigActuators,
}

/// A step with its transition.
#[derive(Debug, Clone)]
pub struct TransitionForecast {
    /// The forecast of the step.
    pub step: StepForecast,
    /// The transition.
    pub transition: Transition,
    /// Duration of the step, s: longer than requested on a stand that arrives late.
    pub dwell_s: f64,
    /// Violated limits of surge margin and speed; empty for an admissible transition.
    pub violations: Vec<TransitionViolation>,
}

/// Forecasts a step of `dwell_s` from `state`, near the steady state `from`, to `target`: on the fastest ramps that leave no limit, or on those that
/// leave it least.
pub fn forecast_transition(
    model: &Model,
    state: State,
    (from, target): (&SteadyState, &SteadyState),
    stand: Stand<'_>,
    dwell_s: f64,
) -> Result<TransitionForecast, SimulationError> {
    let [overlapping, others @ ..] = candidate_ramps(model, from, target, stand.actuators);
    let simulate = |ramps: Ramps| forecast_on_ramps(model, state, (from, target), stand, dwell_s, ramps);
    let worst = |forecast: &TransitionForecast| {
        forecast.violations.iter().map(TransitionViolation::ratio).fold(0.0, f64::max)
    };
    let mut best = simulate(overlapping)?;
    for ramps in others {
        if best.violations.is_empty() {
            break;
        }
        let other = simulate(ramps)?;
        if worst(&other) < worst(&best) {
            best = other;
        }
    }
    Ok(best)
}

fn forecast_on_ramps(
    model: &Model,
    state: State,
    (from, target): (&SteadyState, &SteadyState),
    stand: Stand<'_>,
    dwell_s: f64,
    ramps: Ramps,
) -> Result<TransitionForecast, SimulationError> {
    let inputs = TransitionInputs::new(&from.boundary, &target.boundary, &ramps, stand.actuators);
    let arrival_s = inputs.arrival_s(stand.actuators);
    let dwell_s = extended_dwell_s(dwell_s, arrival_s);
    let step = forecast_step(model, state, &inputs, arrival_s, dwell_s, &stand.limits.avoid)?;
    let transition = Transition {
        ramps,
        arrival_s,
        highest_speed_rpm: step.highest_speed_rpm,
        lowest_surge_margin_ratio: step.lowest_surge_margin_ratio,
        highest_t2_k: step.highest_t2_k,
        avoided: step.avoided,
    };
    let violations = find_violations(model, &step, (from, target), stand.limits);
    Ok(TransitionForecast { step, transition, dwell_s, violations })
}

/// Duration of a step in which P3 and valve arrive after `arrival_s`, s: its window is as long as that of a fast stand.
fn extended_dwell_s(dwell_s: f64, arrival_s: f64) -> f64 {
    dwell_s + (arrival_s - WindowRule::EARLIEST_S).max(0.0).ceil()
}

fn find_violations(
    model: &Model,
    step: &StepForecast,
    (from, target): (&SteadyState, &SteadyState),
    limits: &Limits,
) -> Vec<TransitionViolation> {
    let margin = |steady: &SteadyState| steady.surge_margin_ratio(model);
    let (lowest_ratio, limit_ratio) =
        (step.lowest_surge_margin_ratio, limits.transition_margin_ratio(margin(from), margin(target)));
    let surges = (lowest_ratio < limit_ratio)
        .then_some(TransitionViolation::SurgeMargin { lowest_ratio, limit_ratio });
    let (highest_rpm, max_rpm) = (step.highest_speed_rpm, limits.speed_max_rpm);
    let overspeeds =
        (highest_rpm > max_rpm).then_some(TransitionViolation::Overspeed { highest_rpm, limit_rpm: max_rpm });
    let target_rpm = from.state.shaft_speed_rpm().max(target.state.shaft_speed_rpm());
    let limit_rpm = target_rpm * (1.0 + limits.overshoot_ratio());
    let overshoots = (highest_rpm > limit_rpm).then_some(TransitionViolation::Overshoot {
        highest_rpm,
        target_rpm,
        limit_rpm,
    });
    let slow = step.avoided.filter(|crossing| crossing.ratio() > 1.0).map(TransitionViolation::Avoided);
    [surges, overspeeds, overshoots, slow].into_iter().flatten().collect()
}
