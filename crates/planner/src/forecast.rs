//! One step of the plan on the nominal machine, with what the identification is expected to make of it.

use crate::request::PlanRequest;
use mapper_core::Predicted;
use mapper_physics::forecast::{ForecastRow, StepForecast, forecast_step};
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::SimulationError;

/// A step as it is expected to go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Forecast {
    pub(crate) predicted: Predicted,
    pub(crate) end: State,
    pub(crate) highest_speed_rpm: f64,
    pub(crate) highest_t2_k: f64,
    /// Longest stretch beyond the surge line, s.
    pub(crate) longest_surge_s: f64,
}

/// What the step from `state` to `boundary` is expected to give, and the state at its end.
///
/// Gradients are `None` for the first step of a campaign, which has no jump.
pub(crate) fn forecast(
    request: &PlanRequest<'_>,
    state: State,
    boundary: &BoundaryConditions,
    dwell_s: f64,
    has_jump: bool,
) -> Result<Forecast, SimulationError> {
    let step = forecast_step(request.model, state, boundary, dwell_s)?;
    let mut predicted = step.predicted(&request.window, &request.settle_bands, has_jump);
    if has_jump {
        with_errors(request, &step, dwell_s, &mut predicted);
    }
    Ok(Forecast {
        predicted,
        end: step.end,
        highest_speed_rpm: step.highest_speed_rpm,
        highest_t2_k: step.highest_t2_k,
        longest_surge_s: step.longest_surge_s,
    })
}

/// Adds the errors that the identification will make.
fn with_errors(request: &PlanRequest<'_>, step: &StepForecast, dwell_s: f64, predicted: &mut Predicted) {
    let window = step.window(request.window.of_step_s(predicted.settle_s, dwell_s));
    if window.is_empty() {
        return;
    }
    let Some(found) = request.method.and_then(|method| method.predict(window, step.interval_s)) else {
        return;
    };
    let mean = |value: fn(&ForecastRow) -> f64| window.iter().map(value).sum::<f64>() / window.len() as f64;
    let (own_eta, own_h) = (mean(|row| row.efficiency), mean(|row| row.h_w_m2k));
    predicted.sigma_eta = Some(found.sigma_eta);
    predicted.sigma_h_rel = Some(found.sigma_h_w_m2k / own_h);
    predicted.bias_eta = Some(found.eta - own_eta);
    predicted.bias_h_rel = Some(found.h_w_m2k / own_h - 1.0);
}
