//! Key figures of a plan.

use crate::thermal_memory::forecast::ParameterError;
use mapper_core::{PlanFigures, PlanStep, Predicted};
use mapper_numerics::statistics::rms;

/// Standard error and bias of the efficiency, added in quadrature.
fn error_eta(predicted: &Predicted) -> Option<f64> {
    Some(predicted.sigma_eta?.hypot(predicted.bias_eta.unwrap_or(0.0)))
}

/// Root mean square of the expected errors of the steps that measure a point.
pub(crate) fn rms_error_eta(steps: &[PlanStep]) -> Option<f64> {
    let errors: Vec<f64> = measured_steps(steps).filter_map(error_eta).collect();
    rms(&errors)
}

fn measured_steps(steps: &[PlanStep]) -> impl Iterator<Item = &Predicted> {
    steps.iter().filter(|step| step.kind.measures()).map(|step| &step.predicted)
}

/// Computes the figures from the steps that measure a point. Repeats do not count.
pub(crate) fn compute_figures(
    steps: &[PlanStep],
    minutes: f64,
    parameter_error: Option<ParameterError>,
) -> PlanFigures {
    let gradients = || measured_steps(steps).filter_map(|predicted| predicted.dtc_k).map(f64::abs);
    let largest = |values: &mut dyn Iterator<Item = f64>| values.max_by(f64::total_cmp);
    PlanFigures {
        sum_gradient_k: gradients().sum(),
        min_gradient_k: gradients().min_by(f64::total_cmp),
        worst_sigma_eta: largest(&mut measured_steps(steps).filter_map(|predicted| predicted.sigma_eta)),
        rms_error_eta: rms_error_eta(steps),
        rms_error_reported_eta: parameter_error.map(|parameter_error| parameter_error.reported_eta),
        resting_eta: parameter_error.map(|parameter_error| parameter_error.eta),
        worst_error_eta: largest(&mut measured_steps(steps).filter_map(error_eta)),
        minutes,
    }
}
