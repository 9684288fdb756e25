//! The steps of a plan with other dwells: as long as they may last, or as long as they are expected to.

use crate::figures::figures;
use crate::finish::not_reached;
use crate::forecast::{Forecast, forecast, with_errors_together};
use crate::graph::rejections;
use crate::method::ForecastRow;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{Plan, PlanStep};
use mapper_physics::forecast::warmed_up;
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady::SteadyState;

/// The rows of each step of a plan, each from where the step before leaves the machine after its dwell, and up to `longest_s`.
///
/// # Errors
/// [`PlanError::Forecast`] where a simulation fails.
pub fn forecast_longer(
    request: &PlanRequest<'_>,
    plan: &Plan,
    longest_s: f64,
) -> Result<Vec<Vec<ForecastRow>>, PlanError> {
    let mut rows = Vec::with_capacity(plan.steps.len());
    let without_method = PlanRequest { method: None, ..request.clone() };
    along(&without_method, plan, |state, boundary, step| {
        let has_jump = step.from.is_some();
        rows.push(forecast(&without_method, state, boundary, longest_s, has_jump)?.rows);
        forecast(&without_method, state, boundary, step.dwell_s, has_jump)
    })?;
    Ok(rows)
}

/// A plan with other dwells.
#[derive(Debug, Clone)]
pub struct Retimed {
    /// The plan: forecast, figures and what is said of the required error are those of its dwells.
    pub plan: Plan,
    /// Jumps that a limit forbids from the states in which the machine now makes them, in words.
    pub forbidden: Vec<String>,
}

/// The plan with these dwells, s, in the same order, forecast anew and held against the limits; `as_declared`: with the errors of
/// a machine that is as declared, else those are the open ones.
///
/// # Errors
/// [`PlanError::Forecast`] where a simulation fails.
pub fn with_dwells(
    request: &PlanRequest<'_>,
    plan: &Plan,
    dwells_s: &[f64],
    as_declared: bool,
) -> Result<Retimed, PlanError> {
    let mut retimed = plan.clone();
    let mut start_s = plan.warm_up_s;
    for (step, dwell_s) in retimed.steps.iter_mut().zip(dwells_s) {
        (step.start_s, step.dwell_s) = (start_s, *dwell_s);
        start_s += dwell_s;
    }
    let (mut rows, mut predicted, mut forbidden) = (Vec::new(), Vec::new(), Vec::new());
    let mut p3_pa = None;
    along(request, &retimed, |state, boundary, step| {
        let mut found = forecast(request, state, boundary, step.dwell_s, step.from.is_some())?;
        if let (Some(from), Some(before_pa)) = (step.from, p3_pa.replace(step.p3_pa)) {
            let reasons = rejections(request, &found, step.p3_pa - before_pa, step.t3_k);
            forbidden.extend(reasons.iter().map(|reason| format!("{from} to {}: {reason}", step.to)));
        }
        rows.push(std::mem::take(&mut found.rows));
        predicted.push(found.predicted);
        Ok(found)
    })?;
    with_errors_together(request, &rows, predicted.iter_mut(), as_declared);
    for (step, predicted) in retimed.steps.iter_mut().zip(predicted) {
        step.predicted = predicted;
    }
    retimed.figures = figures(&retimed.steps, retimed.duration_s() / 60.0);
    // What was said of the dwells before no longer holds.
    let before = not_reached(request, &plan.steps);
    retimed.remarks.retain(|remark| Some(remark) != before.as_ref());
    retimed.remarks.extend(not_reached(request, &retimed.steps));
    Ok(Retimed { plan: retimed, forbidden })
}

/// Goes through the steps of a plan, from the warm-up on.
pub(crate) fn along(
    request: &PlanRequest<'_>,
    plan: &Plan,
    mut each: impl FnMut(
        State,
        &BoundaryConditions,
        &PlanStep,
    ) -> Result<Forecast, mapper_physics::simulate::SimulationError>,
) -> Result<(), PlanError> {
    let mut now: Option<State> = None;
    for step in &plan.steps {
        let boundary = BoundaryConditions {
            p3_pa: step.p3_pa,
            t3_k: step.t3_k,
            oil_temperature_k: step.oil_temperature_k,
            valve_opening_ratio: step.to.valve_opening_ratio,
            ..request.boundary
        };
        let fail = |source| PlanError::Forecast { to: step.to, source };
        let state = match now {
            Some(state) => state,
            None => {
                let targets = crate::reach::reachable(request, &[step.to])?;
                let SteadyState { state, .. } = targets.first().ok_or(PlanError::NoPoints)?;
                warmed_up(request.model, *state, &boundary, plan.warm_up_s).map_err(fail)?
            }
        };
        now = Some(each(state, &boundary, step).map_err(fail)?.end);
    }
    Ok(())
}
