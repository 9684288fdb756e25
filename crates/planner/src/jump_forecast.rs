//! Jumps between points: expected result of each, and the limits that forbid it.

use crate::forecast::{Forecast, forecast};
use crate::jump_graph::Rejection;
use crate::request::{PlanError, PlanRequest, solve_steady_states};
use mapper_core::{AvoidedCrossing, OperatingPoint, Predicted, WindowRule};
use mapper_numerics::parallel;
use mapper_physics::simulation::steady::SteadyState;

/// The forecast of a jump from the steady state of one point to another point.
#[derive(Debug, Clone, PartialEq)]
pub struct JumpForecast {
    /// Start of the jump.
    pub from: OperatingPoint,
    /// Destination of the jump.
    pub to: OperatingPoint,
    /// Expected result.
    pub predicted: Predicted,
    /// Time until P3 and valve have arrived, s.
    pub arrival_s: f64,
    /// Lowest surge margin during the jump: flow over the surge flow at equal corrected speed, minus one.
    pub lowest_surge_margin_ratio: f64,
    /// Highest shaft speed during the jump, rpm.
    pub highest_speed_rpm: f64,
    /// Highest outlet temperature during the jump, K.
    pub highest_t2_k: f64,
    /// The slowest crossing of speeds to avoid.
    pub avoided: Option<AvoidedCrossing>,
    /// Turbine inlet total pressure that the jump commands, Pa.
    pub p3_pa: f64,
    /// Change of the turbine inlet pressure, Pa (signed).
    pub p3_change_pa: f64,
    /// All violated limits; empty for an allowed jump.
    pub rejections: Vec<Rejection>,
}

/// Lists all limits that a forecast step violates.
pub(crate) fn find_rejections(
    request: &PlanRequest<'_>,
    forecast: &Forecast,
    target: &SteadyState,
) -> Vec<Rejection> {
    let limits = &request.limits;
    let mut found = forecast.violations.clone();
    if let Some(limit_k) = limits.t2_max_k.filter(|limit_k| forecast.step.highest_t2_k > *limit_k) {
        found.push(Rejection::OutletTemperature { highest_k: forecast.step.highest_t2_k, limit_k });
    }
    let t3_k = target.boundary.t3_k;
    if let Some(limit_k) = limits.t3_max_k.filter(|limit_k| t3_k > *limit_k) {
        found.push(Rejection::TurbineInletTemperature { t3_k, limit_k });
    }
    let gradient_k = forecast.predicted.dtc_k.unwrap_or(0.0).abs();
    if let Some(limit_k) = limits.housing_gradient_max_k.filter(|limit_k| gradient_k > *limit_k) {
        found.push(Rejection::HousingGradient { gradient_k, limit_k });
    }
    if let (WindowRule::Fixed { start_s, .. }, Some(transition)) = (request.window, forecast.transition)
        && transition.arrival_s > start_s
    {
        found.push(Rejection::Arrival { needed_s: transition.arrival_s, available_s: start_s });
    }
    found
}

pub(crate) fn forecast_jump(
    request: &PlanRequest<'_>,
    (from, start): (OperatingPoint, &SteadyState),
    (to, target): (OperatingPoint, &SteadyState),
    dwell_s: f64,
) -> Result<JumpForecast, PlanError> {
    let forecast = forecast(request, start.state, Some(start), target, dwell_s)
        .map_err(|source| PlanError::Forecast { to, source })?;
    Ok(JumpForecast {
        from,
        to,
        predicted: forecast.predicted,
        arrival_s: forecast.transition.map_or(0.0, |transition| transition.arrival_s),
        lowest_surge_margin_ratio: forecast.step.lowest_surge_margin_ratio,
        highest_speed_rpm: forecast.step.highest_speed_rpm,
        highest_t2_k: forecast.step.highest_t2_k,
        avoided: forecast.step.avoided,
        p3_pa: target.boundary.p3_pa,
        p3_change_pa: target.boundary.p3_pa - start.boundary.p3_pa,
        rejections: find_rejections(request, &forecast, target),
    })
}

/// Forecasts the jump from the steady state of `from`, and lists the limits that it violates.
pub fn explain_jump(
    request: &PlanRequest<'_>,
    from: OperatingPoint,
    to: OperatingPoint,
) -> Result<JumpForecast, PlanError> {
    let targets = solve_steady_states(request, &[from, to])?;
    match targets.as_slice() {
        [start, target] => {
            forecast_jump(request, (from, start), (to, target), request.timing.dwell.fixed_or_usual_s())
        }
        _ => Err(PlanError::NoPoints),
    }
}

/// Forecasts all jumps between the points by start, then destination, forbidden ones included. Each costs one simulation: use it for tens
/// of points.
pub fn forecast_all_jumps(request: &PlanRequest<'_>) -> Result<Vec<JumpForecast>, PlanError> {
    let targets = solve_steady_states(request, request.points)?;
    let dwell_s = request.timing.dwell.fixed_or_usual_s();
    let jumps = forecast_jumps(request, request.points, &targets, dwell_s)?;
    Ok(jumps.into_iter().map(|(_, jump)| jump).collect())
}

/// The forecast of a jump, with the indices of start and destination.
type ForecastBetween = ((usize, usize), JumpForecast);

/// Forecasts all jumps between points with these steady states; with the indices of start and destination.
pub(crate) fn forecast_jumps(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
    targets: &[SteadyState],
    dwell_s: f64,
) -> Result<Vec<ForecastBetween>, PlanError> {
    let count = points.len();
    let jumps =
        (0..count).flat_map(|from| (0..count).filter(move |to| *to != from).map(move |to| (from, to)));
    let forecast = |&(from, to): &(usize, usize)| {
        let jump =
            forecast_jump(request, (points[from], &targets[from]), (points[to], &targets[to]), dwell_s)?;
        Ok(((from, to), jump))
    };
    parallel::try_map(&jumps.collect::<Vec<_>>(), forecast)
}
