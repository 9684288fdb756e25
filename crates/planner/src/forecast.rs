//! Simulates one step of the plan on the nominal machine, and predicts the errors of the identification.

use crate::jump_graph::Rejection;
use crate::request::{MethodResult, PlanRequest};
use mapper_core::{Predicted, Transition, VisitOrder};
use mapper_numerics::statistics::rms;
use mapper_physics::operating_point::forecast::{ForecastRow, StepForecast, forecast_step};
use mapper_physics::operating_point::transition::TransitionInputs;
use mapper_physics::operating_point::transition_forecast::{Stand, TransitionForecast, forecast_transition};
use mapper_physics::simulation::model::State;
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyState;

/// Maximum number of steps whose errors are predicted together, so that a large plan takes seconds. Of a longer plan, every n-th step
/// represents the campaign.
const MAX_FORECAST_STEPS: usize = 400;

/// Forecast of a step, with the errors of its identification.
#[derive(Debug, Clone)]
pub(crate) struct Forecast {
    pub(crate) predicted: Predicted,
    pub(crate) step: StepForecast,
    /// The way from the point before; `None` for the first step.
    pub(crate) transition: Option<Transition>,
    /// Duration of the step, s: longer than requested on a stand that arrives late.
    pub(crate) dwell_s: f64,
    /// Limits of surge margin and speed that the transition violates.
    pub(crate) violations: Vec<Rejection>,
}

/// Forecasts a step of `dwell_s` from `state` to `target`: on the fastest ramps that leave no limit, or on those that leave it least. The first step
/// of a campaign has no jump and therefore no gradients.
pub(crate) fn forecast(
    request: &PlanRequest<'_>,
    state: State,
    from: Option<&SteadyState>,
    target: &SteadyState,
    dwell_s: f64,
) -> Result<Forecast, SimulationError> {
    let Some(from) = from else {
        let inputs = TransitionInputs::constant(&target.boundary);
        let step = forecast_step(request.model, state, &inputs, 0.0, dwell_s, &request.limits.avoid)?;
        return Ok(with_errors(request, step, None, dwell_s, Vec::new()));
    };
    let stand = Stand { limits: &request.limits, actuators: &request.actuators };
    let TransitionForecast { step, transition, dwell_s, violations } =
        forecast_transition(request.model, state, (from, target), stand, dwell_s)?;
    let violations = violations.into_iter().map(Rejection::from).collect();
    Ok(with_errors(request, step, Some(transition), dwell_s, violations))
}

fn with_errors(
    request: &PlanRequest<'_>,
    step: StepForecast,
    transition: Option<Transition>,
    dwell_s: f64,
    violations: Vec<Rejection>,
) -> Forecast {
    let has_jump = transition.is_some();
    let mut predicted = step.predicted(&request.window, &request.settle_bands, has_jump);
    if request.order == VisitOrder::Conventional {
        add_settled_error(request, &step, &mut predicted);
    } else if has_jump {
        add_single_step_error(request, &step, dwell_s, &mut predicted);
    }
    Forecast { predicted, step, transition, dwell_s, violations }
}

/// Adds the error of the efficiency that conventional mapping measures at the end of the step.
fn add_settled_error(request: &PlanRequest<'_>, step: &StepForecast, predicted: &mut Predicted) {
    let end = step.rows.last();
    let found = end.zip(request.method).and_then(|(end, method)| Some((end, method.predict_settled(end)?)));
    if let Some((end, (eta, sigma))) = found {
        (predicted.sigma_eta, predicted.bias_eta) = (Some(sigma), Some(eta - end.efficiency));
    }
}

/// Adds the errors of a method that identifies each step separately.
fn add_single_step_error(
    request: &PlanRequest<'_>,
    step: &StepForecast,
    dwell_s: f64,
    predicted: &mut Predicted,
) {
    let Some(method) = request.method else { return };
    let window = step.window(request.window.of_step_s(predicted.settle_s, dwell_s));
    let Some(found) = method.predict_step(window, step.interval_s) else { return };
    let mean = |value: fn(&ForecastRow) -> f64| window.iter().map(value).sum::<f64>() / window.len() as f64;
    set_error(predicted, &found, mean(|row| row.efficiency), mean(|row| row.h_w_m2k));
}

/// Sets the predicted errors: expected result of the method minus the values of the model.
fn set_error(predicted: &mut Predicted, found: &MethodResult, eta: f64, h_w_m2k: f64) {
    predicted.sigma_eta = Some(found.sigma_eta);
    predicted.sigma_h_rel = Some(found.sigma_h_w_m2k / h_w_m2k);
    predicted.bias_eta = Some(found.eta - eta);
    predicted.bias_h_rel = Some(found.h_w_m2k / h_w_m2k - 1.0);
}

/// Efficiency error if the method has to identify the model parameters instead of relying on declared values, fractions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ParameterError {
    pub(crate) eta: f64,
    pub(crate) max_eta: f64,
    /// The error that the method reports, rms.
    pub(crate) reported_eta: f64,
}

/// Adds the errors of a method that identifies all steps together. They are omitted if the steps contain too little information about the
/// parameters, because the prediction is unreliable then. `rows`: forecast rows of each step.
pub(crate) fn add_joint_errors<'a>(
    request: &PlanRequest<'_>,
    rows: &[Vec<ForecastRow>],
    predicted: impl Iterator<Item = &'a mut Predicted>,
) -> Option<ParameterError> {
    let method = request.method.filter(|_| request.order != VisitOrder::Conventional)?;
    let every = rows.len().div_ceil(MAX_FORECAST_STEPS).max(1);
    let sample: Vec<&[ForecastRow]> = rows.iter().step_by(every).map(Vec::as_slice).collect();
    let found = method.predict_campaign(&sample)?;
    let parameter_error = ParameterError {
        eta: found.parameter_error_eta,
        max_eta: found.max_parameter_error_eta,
        reported_eta: rms(found.reported_sigma_eta.iter().flatten().copied())?,
    };
    if parameter_error.eta <= parameter_error.max_eta {
        let undeclared = found.undeclared_sigma_eta.into_iter().chain(std::iter::repeat(None));
        let results = found.steps.into_iter().zip(found.reported_sigma_eta).zip(undeclared);
        for ((predicted, rows), ((found, reported), undeclared)) in
            predicted.step_by(every).zip(&sample).zip(results)
        {
            if let (Some(found), Some(end)) = (found, rows.last()) {
                set_error(predicted, &found, end.efficiency, end.h_w_m2k);
                (predicted.reported_sigma_eta, predicted.undeclared_sigma_eta) = (reported, undeclared);
            }
        }
    }
    Some(parameter_error)
}
