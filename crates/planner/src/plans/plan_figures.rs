//! A plan in a few numbers.

use crate::thermal_memory::forecast::Resting;
use mapper_core::{PlanFigures, PlanStep, Predicted};
use mapper_numerics::statistics::rms;

/// Standard error and bias of the efficiency in quadrature.
fn error_eta(predicted: &Predicted) -> Option<f64> {
    Some(predicted.sigma_eta?.hypot(predicted.bias_eta.unwrap_or(0.0)))
}

/// Root of the mean square of the expected errors, of the steps that measure a point.
pub(crate) fn rms_error_eta(steps: &[PlanStep]) -> Option<f64> {
    let errors: Vec<f64> = measured(steps).filter_map(error_eta).collect();
    rms(&errors)
}

fn measured(steps: &[PlanStep]) -> impl Iterator<Item = &Predicted> {
    steps.iter().filter(|step| step.kind.measures()).map(|step| &step.predicted)
}

/// The figures, of the steps that measure a point: a repeat is there to compare.
pub(crate) fn figures(steps: &[PlanStep], minutes: f64, resting: Option<Resting>) -> PlanFigures {
    let gradients = || measured(steps).filter_map(|predicted| predicted.dtc_k).map(f64::abs);
    let largest = |values: &mut dyn Iterator<Item = f64>| values.max_by(f64::total_cmp);
    PlanFigures {
        sum_gradient_k: gradients().sum(),
        min_gradient_k: gradients().min_by(f64::total_cmp),
        worst_sigma_eta: largest(&mut measured(steps).filter_map(|predicted| predicted.sigma_eta)),
        rms_error_eta: rms_error_eta(steps),
        rms_error_undeclared_eta: resting.map(|resting| resting.undeclared_eta),
        worst_error_eta: largest(&mut measured(steps).filter_map(error_eta)),
        minutes,
    }
}
