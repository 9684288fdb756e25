//! What the plan is better than: conventional mapping with its waits, and the same points along speed lines.

use crate::forecast::forecast;
use crate::method::ForecastRow;
use crate::reach::reachable;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{OperatingPoint, Plan, VisitOrder};
use mapper_numerics::statistics::mean;
use mapper_physics::forecast::{self, hold};
use mapper_physics::model::{Outputs, State};
use mapper_physics::steady::SteadyState;

/// Drift of T2 and of the housing below which conventional mapping takes its reading, K/min.
pub const STABLE_DRIFT_K_MIN: f64 = 0.5;
/// Interval at which that is looked at, s.
const LOOK_S: f64 = 10.0;
/// Longest wait at a point, s.
const LONGEST_WAIT_S: f64 = 3600.0;

/// A way to map the points, in three numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct WayOfMapping {
    /// Points in order, the first once more where it is visited again.
    pub order: Vec<OperatingPoint>,
    /// Duration without warm-up and cool-down, minutes.
    pub minutes: f64,
    /// Largest predicted error of the efficiency (absolute, standard error and bias in quadrature), fraction; `None`
    /// where none was predicted.
    pub worst_error_eta: Option<f64>,
    /// Mean of these errors, fraction.
    pub mean_error_eta: Option<f64>,
}

/// The plan beside what it is held against.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The plan.
    pub proposed: WayOfMapping,
    /// Along speed lines, at each point until T2 and the housing drift by less than [`STABLE_DRIFT_K_MIN`], efficiency
    /// from the temperature rise. Its error is that of heat transfer and of declared offsets.
    pub conventional: WayOfMapping,
    /// Along speed lines, with the plan's method and dwell.
    pub along_speed_lines: WayOfMapping,
}

/// Points along speed lines: by speed, on each line from the widest opening to the narrowest.
pub fn along_speed_lines(points: &[OperatingPoint]) -> Vec<OperatingPoint> {
    let mut order = points.to_vec();
    order.sort_by(|a, b| {
        a.speed_rpm.total_cmp(&b.speed_rpm).then(b.valve_opening_ratio.total_cmp(&a.valve_opening_ratio))
    });
    order
}

/// Compares `plan` with both.
///
/// # Errors
/// [`PlanError`] where a simulation fails.
pub fn compare(request: &PlanRequest<'_>, plan: &Plan) -> Result<Comparison, PlanError> {
    let order = along_speed_lines(request.points);
    let targets = reachable(request, &order)?;
    let listed = PlanRequest { order: VisitOrder::Listed, ..request.clone() };
    Ok(Comparison {
        proposed: way(
            plan.steps.iter().map(|step| step.to).collect(),
            plan.steps.iter().map(|step| step.dwell_s).sum(),
            // A repeat measures no point.
            plan.steps
                .iter()
                .filter(|step| step.kind.measures())
                .map(|step| error(step.predicted.sigma_eta, step.predicted.bias_eta)),
        ),
        conventional: conventional(request, &order, &targets)?,
        along_speed_lines: dynamic(&listed, &order, &targets)?,
    })
}

fn error(sigma: Option<f64>, bias: Option<f64>) -> Option<f64> {
    Some(sigma?.hypot(bias?))
}

fn way(order: Vec<OperatingPoint>, seconds: f64, errors: impl Iterator<Item = Option<f64>>) -> WayOfMapping {
    let errors: Vec<f64> = errors.flatten().collect();
    WayOfMapping {
        order,
        minutes: seconds / 60.0,
        worst_error_eta: errors.iter().copied().max_by(f64::total_cmp),
        mean_error_eta: mean(&errors),
    }
}

fn warmed_up(request: &PlanRequest<'_>, first: &SteadyState) -> Result<State, PlanError> {
    let to = OperatingPoint {
        speed_rpm: first.state.shaft_speed_rpm(),
        valve_opening_ratio: first.boundary.valve_opening_ratio,
    };
    forecast::warmed_up(request.model, first.state, &first.boundary, request.timing.warm_up_s)
        .map_err(|source| PlanError::Forecast { to, source })
}

fn conventional(
    request: &PlanRequest<'_>,
    order: &[OperatingPoint],
    targets: &[SteadyState],
) -> Result<WayOfMapping, PlanError> {
    let first = targets.first().ok_or(PlanError::NoPoints)?;
    let mut state = warmed_up(request, first)?;
    let (mut seconds, mut errors) = (0.0, Vec::with_capacity(order.len()));
    for (&to, target) in order.iter().zip(targets) {
        let prepared = request.model.prepare(&target.boundary);
        let mut outputs: Option<Outputs> = None;
        let mut waited_s = 0.0;
        while waited_s < LONGEST_WAIT_S {
            let tc_k = state.tc_k;
            state = hold(request.model, state, &target.boundary, LOOK_S)
                .map_err(|source| PlanError::Forecast { to, source })?;
            waited_s += LOOK_S;
            let now = prepared.evaluate(&state);
            let drift_k_min = 60.0 / LOOK_S
                * outputs
                    .map_or(f64::INFINITY, |before| (now.t2_probe_k - before.t2_probe_k).abs())
                    .max((state.tc_k - tc_k).abs());
            outputs = Some(now);
            if drift_k_min < STABLE_DRIFT_K_MIN {
                break;
            }
        }
        seconds += waited_s;
        errors.push(outputs.zip(request.method).and_then(|(outputs, method)| {
            let row = ForecastRow {
                t_s: waited_s,
                speed_rpm: state.shaft_speed_rpm(),
                flow_kg_s: outputs.flow_kg_s,
                t1_k: target.boundary.t1_k,
                p1_pa: target.boundary.p1_pa,
                p2_pa: state.p2_pa,
                t2_k: outputs.t2_probe_k,
                tc_k: state.tc_k,
                efficiency: outputs.efficiency,
                h_w_m2k: outputs.h_w_m2k,
            };
            let (eta, sigma) = method.predict_settled(&row)?;
            error(Some(sigma), Some(eta - outputs.efficiency))
        }));
    }
    Ok(way(order.to_vec(), seconds, errors.into_iter()))
}

fn dynamic(
    request: &PlanRequest<'_>,
    order: &[OperatingPoint],
    targets: &[SteadyState],
) -> Result<WayOfMapping, PlanError> {
    let first = targets.first().ok_or(PlanError::NoPoints)?;
    let mut state = warmed_up(request, first)?;
    let dwell_s = request.timing.dwell_s;
    // No jump leads to the first point here either.
    let back = usize::from(request.return_to_first && order.len() > 1);
    let steps: Vec<_> = order.iter().zip(targets).cycle().take(order.len() + back).collect();
    let mut errors = Vec::with_capacity(steps.len());
    for (i, &(&to, target)) in steps.iter().enumerate() {
        let step = forecast(request, state, &target.boundary, dwell_s, i > 0)
            .map_err(|source| PlanError::Forecast { to, source })?;
        errors.push(error(step.predicted.sigma_eta, step.predicted.bias_eta));
        state = step.end;
    }
    Ok(way(steps.iter().map(|(to, _)| **to).collect(), dwell_s * steps.len() as f64, errors.into_iter()))
}
