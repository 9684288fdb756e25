//! The request of a sequence, and the forecast of its steps.

use mapper_core::{
    Limits, OperatingPoint, Predicted, RigActuators, SetpointRanges, SettleBands, Timing, Transition,
    WindowRule,
};
use mapper_physics::laws::housing::{StandstillState, relax};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::forecast::{forecast_step, hold, warm_up_state};
use mapper_physics::operating_point::reach::{FollowOutlet, describe_obstacles, reach};
use mapper_physics::operating_point::transition::TransitionInputs;
use mapper_physics::operating_point::transition_forecast::{Stand, forecast_transition};
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
    /// Setpoints that the rig accepts, if it states them.
    pub accepts: Option<SetpointRanges>,
    /// Motion of the stand's actuators.
    pub actuators: RigActuators,
    /// The planner.
    pub order: OrderPoints,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub message: String,
    pub remedy: String,
}

impl SequenceRequest {
    /// Solves the steady state of a point, or refuses it because it violates a limit.
    pub(crate) fn check(&self, point: OperatingPoint) -> Result<SteadyState, Refusal> {
        reach(&self.model, point, &self.boundary, self.follow_outlet, &self.limits).map_err(|obstacles| {
            Refusal {
                message: format!("{} {}", point.in_words(), describe_obstacles(&obstacles)),
                remedy: obstacles.first().map_or("", |obstacle| obstacle.remedy()).to_owned(),
            }
        })
    }
}

/// Maximum difference between executed and planned duration for a step to end in the planned state, s: one forecast interval.
const PLANNED_TOLERANCE_S: f64 = 0.5;

pub(crate) struct StepPrediction {
    pub predicted: Predicted,
    /// The way from the point before; `None` for the first step.
    pub transition: Option<Transition>,
    pub dwell_s: f64,
}

/// State of the nominal machine along a sequence.
pub(crate) struct NominalForecast {
    /// State at the start of the current step; `None` before the first.
    state: Option<State>,
    /// Its housings at the end of a rest before the step.
    at_rest: Option<StandstillState>,
    /// Steady state of the latest step's point.
    from: Option<SteadyState>,
    /// Planned duration of the current step, s, and its final state.
    planned: Option<(f64, State)>,
}

impl NominalForecast {
    pub(crate) fn new() -> Self {
        NominalForecast { state: None, at_rest: None, from: None, planned: None }
    }

    /// Predicts the result of a step to `target`, with its duration, s, and its way from the point before.
    ///
    /// On a stand that arrives late the step lasts longer than requested.
    pub(crate) fn forecast(
        &mut self,
        request: &SequenceRequest,
        target: &SteadyState,
        dwell_s: f64,
    ) -> Result<StepPrediction, SimulationError> {
        let state = match (self.at_rest.take(), self.state) {
            (Some(StandstillState { tc_k, tt_k }), _) => State { tc_k, tt_k, ..target.state },
            (None, Some(state)) => state,
            (None, None) => {
                warm_up_state(&request.model, target.state, &target.boundary, request.timing.warm_up_s)?
            }
        };
        self.state = Some(state);
        let (step, transition, dwell_s) = match self.from.replace(*target) {
            Some(from) => {
                let stand = Stand { limits: &request.limits, actuators: &request.actuators };
                let forecast = forecast_transition(&request.model, state, (&from, target), stand, dwell_s)?;
                (forecast.step, Some(forecast.transition), forecast.dwell_s)
            }
            None => {
                let inputs = TransitionInputs::constant(&target.boundary);
                let avoid = &request.limits.avoid;
                (forecast_step(&request.model, state, &inputs, 0.0, dwell_s, avoid)?, None, dwell_s)
            }
        };
        self.planned = Some((dwell_s, step.end));
        let predicted = step.predicted(&request.window, &request.settle_bands, transition.is_some());
        Ok(StepPrediction { predicted, transition, dwell_s })
    }

    /// Lets the machine rest without air: its housings cool, and the next step has no point before.
    pub(crate) fn rest(&mut self, request: &SequenceRequest, duration_s: f64) {
        self.from = None;
        let BoundaryConditions { oil_temperature_k, ambient_temperature_k, .. } = request.boundary;
        if let Some(State { tc_k, tt_k, .. }) = self.state {
            let warm = StandstillState { tc_k, tt_k };
            let params = &request.model.params;
            self.at_rest = Some(relax(params, warm, oil_temperature_k, ambient_temperature_k, duration_s));
        }
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
