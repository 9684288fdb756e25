//! One step of the plan on the nominal machine, with what the identification is expected to make of it.

use crate::method::MethodResult;
use crate::request::PlanRequest;
use mapper_core::Predicted;
use mapper_physics::forecast::{ForecastRow, StepForecast, forecast_step};
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::SimulationError;

/// Most steps whose errors are forecast together: of more, a sample is, which takes them for a campaign of its own.
pub(crate) const MOST_TOGETHER: usize = 400;

/// A step as it is expected to go.
#[derive(Debug, Clone)]
pub(crate) struct Forecast {
    pub(crate) predicted: Predicted,
    pub(crate) end: State,
    pub(crate) highest_speed_rpm: f64,
    pub(crate) highest_t2_k: f64,
    /// Longest stretch beyond the surge line, s.
    pub(crate) longest_surge_s: f64,
    /// The step from its jump to its end.
    pub(crate) rows: Vec<ForecastRow>,
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
    let step = match request.simulations {
        Some(simulations) => simulations.step(request.model, state, boundary, dwell_s)?,
        None => forecast_step(request.model, state, boundary, dwell_s)?,
    };
    let mut predicted = step.predicted(&request.window, &request.settle_bands, has_jump);
    if has_jump && request.method.is_some_and(|method| !method.is_joint()) {
        with_errors(request, &step, dwell_s, &mut predicted);
    }
    Ok(Forecast {
        predicted,
        end: step.end,
        highest_speed_rpm: step.highest_speed_rpm,
        highest_t2_k: step.highest_t2_k,
        longest_surge_s: step.longest_surge_s,
        rows: step.rows,
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
    tell(predicted, &found, mean(|row| row.efficiency), mean(|row| row.h_w_m2k));
}

/// Puts what a method finds beside what the model has.
fn tell(predicted: &mut Predicted, found: &MethodResult, eta: f64, h_w_m2k: f64) {
    predicted.sigma_eta = Some(found.sigma_eta);
    predicted.open_sigma_eta = Some(found.open_sigma_eta);
    predicted.sigma_h_rel = Some(found.sigma_h_w_m2k / h_w_m2k);
    predicted.bias_eta = Some(found.eta - eta);
    predicted.bias_h_rel = Some(found.h_w_m2k / h_w_m2k - 1.0);
}

/// Adds the errors that a method makes which identifies all steps together. `rows`: those of each step.
pub(crate) fn with_errors_together<'a>(
    request: &PlanRequest<'_>,
    rows: &[Vec<ForecastRow>],
    predicted: impl Iterator<Item = &'a mut Predicted>,
    as_declared: bool,
) {
    let Some(method) = request.method.filter(|method| method.is_joint()) else { return };
    let every = rows.len().div_ceil(MOST_TOGETHER).max(1);
    let sample: Vec<&[ForecastRow]> = rows.iter().step_by(every).map(Vec::as_slice).collect();
    let Some(found) = method.together(&sample, as_declared) else { return };
    for ((predicted, rows), found) in predicted.step_by(every).zip(&sample).zip(found) {
        if let (Some(found), Some(end)) = (found, rows.last()) {
            tell(predicted, &found, end.efficiency, end.h_w_m2k);
        }
    }
}
