//! Predicts each step with the nominal machine, from the thermal state after the previous step.

use crate::request::SequenceRequest;
use mapper_core::Predicted;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::forecast::{forecast_step, hold, warm_up_state};
use mapper_physics::simulation::model::State;
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyState;

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
