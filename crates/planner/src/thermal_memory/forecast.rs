//! One step of the plan on the nominal machine, with what the identification is expected to make of it.

use crate::method::MethodResult;
use crate::request::PlanRequest;
use mapper_core::{Predicted, VisitOrder};
use mapper_numerics::statistics::rms;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::forecast::{ForecastRow, StepForecast, forecast_step};
use mapper_physics::simulation::model::State;
use mapper_physics::simulation::simulate::SimulationError;

/// Most steps whose errors are forecast together, so that the forecast of a large plan takes seconds: of more, every n-th step
/// stands for the campaign.
const MAX_TOGETHER: usize = 400;

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
    let step = forecast_step(request.model, state, boundary, dwell_s)?;
    let mut predicted = step.predicted(&request.window, &request.settle_bands, has_jump);
    if request.order == VisitOrder::Conventional {
        settled_error(request, &step, &mut predicted);
    } else if has_jump {
        error_alone(request, &step, dwell_s, &mut predicted);
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

/// Adds the error of the efficiency that conventional mapping reads at the end of the step.
fn settled_error(request: &PlanRequest<'_>, step: &StepForecast, predicted: &mut Predicted) {
    let end = step.rows.last();
    let found = end.zip(request.method).and_then(|(end, method)| Some((end, method.settled(end)?)));
    if let Some((end, (eta, sigma))) = found {
        (predicted.sigma_eta, predicted.bias_eta) = (Some(sigma), Some(eta - end.efficiency));
    }
}

/// Adds the errors of a method that identifies each step by itself.
fn error_alone(request: &PlanRequest<'_>, step: &StepForecast, dwell_s: f64, predicted: &mut Predicted) {
    let Some(method) = request.method else { return };
    let window = step.window(request.window.of_step_s(predicted.settle_s, dwell_s));
    let Some(found) = method.alone(window, step.interval_s) else { return };
    let mean = |value: fn(&ForecastRow) -> f64| window.iter().map(value).sum::<f64>() / window.len() as f64;
    set_error(predicted, &found, mean(|row| row.efficiency), mean(|row| row.h_w_m2k));
}

/// Compares what a method finds with what the model has.
fn set_error(predicted: &mut Predicted, found: &MethodResult, eta: f64, h_w_m2k: f64) {
    predicted.sigma_eta = Some(found.sigma_eta);
    predicted.sigma_h_rel = Some(found.sigma_h_w_m2k / h_w_m2k);
    predicted.bias_eta = Some(found.eta - eta);
    predicted.bias_h_rel = Some(found.h_w_m2k / h_w_m2k - 1.0);
}

/// How much the expected errors rest on the declaration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resting {
    pub(crate) eta: f64,
    pub(crate) max_eta: f64,
    /// Root of the mean square of the errors if nothing that the method may find is as declared.
    pub(crate) undeclared_eta: f64,
}

/// Adds the errors of a method that identifies all steps together, if the steps give enough information for points to be good: a forecast of
/// fewer does not hold. `rows`: those of each step.
pub(crate) fn errors_together<'a>(
    request: &PlanRequest<'_>,
    rows: &[Vec<ForecastRow>],
    predicted: impl Iterator<Item = &'a mut Predicted>,
) -> Option<Resting> {
    let method = request.method.filter(|_| request.order != VisitOrder::Conventional)?;
    let every = rows.len().div_ceil(MAX_TOGETHER).max(1);
    let sample: Vec<&[ForecastRow]> = rows.iter().step_by(every).map(Vec::as_slice).collect();
    let found = method.together(&sample)?;
    let sigmas: Vec<f64> = found.steps.iter().flatten().map(|found| found.sigma_eta).collect();
    let resting = Resting {
        eta: found.resting_eta,
        max_eta: found.max_resting_eta,
        undeclared_eta: rms(&sigmas)?.hypot(found.resting_eta),
    };
    if resting.eta <= resting.max_eta {
        for ((predicted, rows), found) in predicted.step_by(every).zip(&sample).zip(found.steps) {
            if let (Some(found), Some(end)) = (found, rows.last()) {
                set_error(predicted, &found, end.efficiency, end.h_w_m2k);
            }
        }
    }
    Some(resting)
}
