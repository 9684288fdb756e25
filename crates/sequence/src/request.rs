//! The request of a sequence, and the forecast of its steps.

use mapper_core::{Limits, OperatingPoint, Predicted, SettleBands, Timing, WindowRule};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::forecast::{forecast_step, hold, warm_up_state};
use mapper_physics::operating_point::reach::FollowOutlet;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::simulation::model::{Model, State};
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyState;

/// Asks the planner for the order of a set of points; the error is a sentence.
pub type OrderPoints = Box<dyn Fn(&[OperatingPoint]) -> Result<Vec<OperatingPoint>, String> + Send>;

/// All inputs of a sequence except its script.
pub struct SequenceRequest {
    /// The campaign's grid.
    pub points: Vec<OperatingPoint>,
    /// Durations; the dwell applies unless the script sets its own.
    pub timing: Timing,
    /// Part of a step over which gradients are predicted.
    pub window: WindowRule,
    /// Criterion for a settled point.
    pub settle_bands: SettleBands,
    /// The nominal machine.
    pub model: Model,
    /// Nominal boundary conditions; each step has its own P3 and valve opening.
    pub boundary: BoundaryConditions,
    /// Boundary temperatures that follow the compressor outlet temperature of each point.
    pub follow_outlet: FollowOutlet,
    /// Limits of every step.
    pub limits: Limits,
    /// The planner.
    pub order: OrderPoints,
}

/// Refusal of a step.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub message: String,
    pub remedy: String,
}

impl SequenceRequest {
    /// Solves the steady state of a point, or refuses it because it violates a limit.
    pub(crate) fn check(&self, point: OperatingPoint) -> Result<SteadyState, Refusal> {
        reach(&self.model, point, &self.boundary, self.follow_outlet, &self.limits).map_err(|obstacles| {
            let (krpm, opening) = (point.speed_rpm / 1e3, point.valve_opening_ratio);
            Refusal {
                message: format!("{krpm} krpm at opening {opening} {}", describe_obstacles(&obstacles)),
                remedy: obstacles.first().map_or("", |obstacle| obstacle.remedy()).to_owned(),
            }
        })
    }
}

/// Maximum difference between executed and planned duration for a step to end in the planned state, s: one forecast interval.
const PLANNED_TOLERANCE_S: f64 = 0.5;

/// State of the nominal machine along a sequence.
pub(crate) struct NominalForecast {
    /// State at the start of the current step; `None` before the first.
    state: Option<State>,
    /// Planned duration of the current step, s, and its final state.
    planned: Option<(f64, State)>,
}

impl NominalForecast {
    pub(crate) fn new() -> Self {
        NominalForecast { state: None, planned: None }
    }

    /// Predicts the result of a step to `target`.
    pub(crate) fn forecast(
        &mut self,
        request: &SequenceRequest,
        target: &SteadyState,
        dwell_s: f64,
        has_jump: bool,
    ) -> Result<Predicted, SimulationError> {
        let state = match self.state {
            Some(state) => state,
            None => warm_up_state(&request.model, target.state, &target.boundary, request.timing.warm_up_s)?,
        };
        self.state = Some(state);
        let step = forecast_step(&request.model, state, &target.boundary, dwell_s)?;
        self.planned = Some((dwell_s, step.end));
        Ok(step.predicted(&request.window, &request.settle_bands, has_jump))
    }

    /// Ends the current step after `duration_s`.
    pub(crate) fn finish(
        &mut self,
        request: &SequenceRequest,
        boundary: &BoundaryConditions,
        duration_s: f64,
    ) -> Result<(), SimulationError> {
        if let Some((planned_s, end)) = self.planned.take()
            && (planned_s - duration_s).abs() < PLANNED_TOLERANCE_S
        {
            self.state = Some(end);
        } else if let Some(state) = self.state {
            self.state = Some(hold(&request.model, state, boundary, duration_s)?);
        }
        Ok(())
    }
}
