//! Simulates the steps of an order with the full model.

use crate::forecast::{Forecast, ParameterError, add_joint_errors, forecast};
use crate::jump_forecast::find_rejections;
use crate::jump_graph::Rejection;
use crate::request::{PlanError, PlanRequest};
use crate::visits::Visit;
use mapper_core::{OperatingPoint, PlanStep, VisitOrder};
use mapper_physics::operating_point::forecast::{hold, warm_up_state};
use mapper_physics::simulation::model::State;
use mapper_physics::simulation::steady::SteadyState;

/// Drift of T2 and of the housing below which conventional mapping takes its reading, K/min: a fifth of the 0.5 K/min allowed for a
/// settled point (`steady`), because with noise some readings pass too early (`campaigns/stabilised.rhai`).
pub const STABLE_DRIFT_K_MIN: f64 = 0.1;
/// Interval over which conventional mapping measures the drift, s.
const DRIFT_INTERVAL_S: f64 = 10.0;
/// Maximum wait of conventional mapping at a point, s: an hour, four times the longest wait in Burke et al.
const MAX_WAIT_S: f64 = 3600.0;

/// A forbidden jump of an order, with the violated limits.
pub(crate) struct ForbiddenJump {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) reasons: Vec<Rejection>,
}

/// The simulated steps, and the forbidden jumps among them.
pub(crate) struct Walk {
    pub(crate) steps: Vec<PlanStep>,
    pub(crate) forbidden: Vec<ForbiddenJump>,
    pub(crate) parameter_error: Option<ParameterError>,
}

/// Simulates the visits, `dwell_s` each, and predicts their errors. `targets`: the steady states of `points`.
pub(crate) fn walk(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
    targets: &[SteadyState],
    visits: &[Visit],
    dwell_s: f64,
) -> Result<Walk, PlanError> {
    let mut steps: Vec<PlanStep> = Vec::with_capacity(visits.len());
    let (mut rows, mut forbidden) = (Vec::new(), Vec::new());
    let mut start_s = request.timing.warm_up_s;
    let mut now: Option<(State, usize)> = None;
    for visit in visits {
        let (to, target) = (points[visit.index], &targets[visit.index]);
        let fail = |source| PlanError::Forecast { to, source };
        let state = match now {
            Some((state, _)) => state,
            None => warm_up_state(request.model, target.state, &target.boundary, request.timing.warm_up_s)
                .map_err(fail)?,
        };
        let dwell_s = match request.order {
            VisitOrder::Conventional => stable_after_s(request, to, state, target)?.max(dwell_s),
            _ => dwell_s,
        };
        let from = now.map(|(_, from)| from);
        let start = from.map(|from| &targets[from]);
        let step_forecast = forecast(request, state, start, target, dwell_s).map_err(fail)?;
        if let Some(from) = from {
            let reasons = find_rejections(request, &step_forecast, target);
            if !reasons.is_empty() {
                forbidden.push(ForbiddenJump { from, to: visit.index, reasons });
            }
        }
        let Forecast { predicted, step, transition, dwell_s, .. } = step_forecast;
        steps.push(PlanStep {
            index: steps.len(),
            kind: visit.kind,
            from: from.map(|from| points[from]),
            to,
            p3_pa: target.boundary.p3_pa,
            t3_k: target.boundary.t3_k,
            oil_temperature_k: target.boundary.oil_temperature_k,
            dwell_s,
            start_s,
            transition,
            predicted,
        });
        start_s += dwell_s;
        now = Some((step.end, visit.index));
        rows.push(step.rows);
    }
    let predicted = steps.iter_mut().map(|step| &mut step.predicted);
    let parameter_error =
        if forbidden.is_empty() { add_joint_errors(request, &rows, predicted) } else { None };
    Ok(Walk { steps, forbidden, parameter_error })
}

/// Time until T2 and the housing drift by less than [`STABLE_DRIFT_K_MIN`], s.
fn stable_after_s(
    request: &PlanRequest<'_>,
    to: OperatingPoint,
    start: State,
    target: &SteadyState,
) -> Result<f64, PlanError> {
    let prepared = request.model.prepare(&target.boundary);
    let reading = |state: &State| (prepared.evaluate(state).t2_probe_k, state.tc_k);
    let (mut state, mut waited_s) = (start, 0.0);
    while waited_s < MAX_WAIT_S {
        let (t2_k, tc_k) = reading(&state);
        state = hold(request.model, state, &target.boundary, DRIFT_INTERVAL_S)
            .map_err(|source| PlanError::Forecast { to, source })?;
        waited_s += DRIFT_INTERVAL_S;
        let now = reading(&state);
        let drift_k_min = 60.0 / DRIFT_INTERVAL_S * (now.0 - t2_k).abs().max((now.1 - tc_k).abs());
        // The first interval contains the jump itself.
        if waited_s > DRIFT_INTERVAL_S && drift_k_min < STABLE_DRIFT_K_MIN {
            break;
        }
    }
    Ok(waited_s)
}
