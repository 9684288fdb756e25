//! A plan in a few numbers.

use crate::request::PlanRequest;
use mapper_core::{PlanFigures, PlanStep, Predicted};
use mapper_numerics::statistics::rms;

/// Standard error and bias of the efficiency in quadrature.
pub(crate) fn error_eta(predicted: &Predicted) -> Option<f64> {
    Some(predicted.sigma_eta?.hypot(predicted.bias_eta.unwrap_or(0.0)))
}

/// Root of the mean square of the errors where nothing is as declared, of the steps that measure a point.
pub(crate) fn open_rms_error_eta(steps: &[PlanStep]) -> Option<f64> {
    let points = steps.iter().filter(|step| step.kind.measures()).map(|step| &step.predicted);
    let errors: Vec<f64> = points
        .filter_map(|predicted| Some(predicted.open_sigma_eta?.hypot(predicted.bias_eta.unwrap_or(0.0))))
        .collect();
    rms(&errors)
}

/// The figures, of the steps that measure a point: a repeat is there to compare.
pub(crate) fn figures(steps: &[PlanStep], minutes: f64) -> PlanFigures {
    let points = || steps.iter().filter(|step| step.kind.measures()).map(|step| &step.predicted);
    let gradients = || points().filter_map(|predicted| predicted.dtc_k).map(f64::abs);
    let errors: Vec<f64> = points().filter_map(error_eta).collect();
    let largest = |values: &mut dyn Iterator<Item = f64>| values.max_by(f64::total_cmp);
    PlanFigures {
        sum_gradient_k: gradients().sum(),
        worst_gradient_k: gradients().min_by(f64::total_cmp),
        worst_sigma_eta: largest(&mut points().filter_map(|predicted| predicted.sigma_eta)),
        rms_error_eta: rms(&errors),
        open_rms_error_eta: open_rms_error_eta(steps),
        worst_error_eta: largest(&mut errors.iter().copied()),
        minutes,
    }
}

/// How long a plan of these steps takes, warm-up and cool-down included, s.
pub(crate) fn duration_s(request: &PlanRequest<'_>, steps: &[PlanStep]) -> f64 {
    request.timing.warm_up_s + steps.iter().map(|step| step.dwell_s).sum::<f64>() + request.timing.cool_down_s
}
