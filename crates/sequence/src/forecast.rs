//! What the nominal machine expects of each step, its housings' memory carried from step to step.

use crate::request::SequenceRequest;
use mapper_core::Predicted;
use mapper_physics::forecast::{forecast_step, hold, warmed_up};
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::SimulationError;
use mapper_physics::steady::SteadyState;

/// A step that ends within this of its planned time ends in the planned state, s: an interval of the forecast.
const AS_PLANNED_S: f64 = 0.5;

/// The nominal machine along a sequence.
pub(crate) struct Nominal {
    /// At the start of the current step; `None` before the first.
    state: Option<State>,
    /// Planned duration of the current step, s, and the state it would end in.
    planned: Option<(f64, State)>,
}

impl Nominal {
    pub(crate) fn new() -> Self {
        Nominal { state: None, planned: None }
    }

    /// What a step to `target` is expected to give.
    pub(crate) fn forecast(
        &mut self,
        request: &SequenceRequest,
        target: &SteadyState,
        dwell_s: f64,
        has_jump: bool,
    ) -> Result<Predicted, SimulationError> {
        let state = match self.state {
            Some(state) => state,
            None => warmed_up(&request.model, target.state, &target.boundary, request.timing.warm_up_s)?,
        };
        self.state = Some(state);
        let step = forecast_step(&request.model, state, &target.boundary, dwell_s)?;
        self.planned = Some((dwell_s, step.end));
        Ok(step.predicted(&request.window, &request.settle_bands, has_jump))
    }

    /// The step has lasted `duration_s`.
    pub(crate) fn finish(
        &mut self,
        request: &SequenceRequest,
        boundary: &BoundaryConditions,
        duration_s: f64,
    ) -> Result<(), SimulationError> {
        if let Some((planned_s, end)) = self.planned.take()
            && (planned_s - duration_s).abs() < AS_PLANNED_S
        {
            self.state = Some(end);
        } else if let Some(state) = self.state {
            self.state = Some(hold(&request.model, state, boundary, duration_s)?);
        }
        Ok(())
    }
}
