//! The steps of an order in full, simulated one after the other.

use crate::figures::error_eta;
use crate::forecast::{Forecast, forecast, with_errors_together};
use crate::graph::rejections;
use crate::method::ForecastRow;
use crate::repeats::Visit;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{OperatingPoint, PlanStep, StepKind, WindowRule};
use mapper_physics::forecast::warmed_up;
use mapper_physics::model::State;
use mapper_physics::simulate::SimulationError;
use mapper_physics::steady::SteadyState;

/// Dwells tried for a step that is identified by itself lie this far apart, s.
const DWELL_STEP_S: f64 = 5.0;
/// Shortest of them, s: the earliest window with the shortest useful length.
const SHORTEST_DWELL_S: f64 = WindowRule::EARLIEST_S + WindowRule::SHORTEST_S;

/// A jump of a plan that is not allowed.
pub(crate) struct Forbidden {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) reasons: String,
}

/// What is gone through, and in which order.
#[derive(Clone, Copy)]
pub(crate) struct Route<'a> {
    pub(crate) points: &'a [OperatingPoint],
    /// Their steady states.
    pub(crate) targets: &'a [SteadyState],
    pub(crate) visits: &'a [Visit],
    /// The point that a repeated jump ends at.
    pub(crate) repeated: Option<usize>,
}

/// The steps, and the jumps among them that are not allowed.
pub(crate) struct Walk {
    pub(crate) steps: Vec<PlanStep>,
    pub(crate) forbidden: Vec<Forbidden>,
    /// Each step from its jump to its end.
    pub(crate) rows: Vec<Vec<ForecastRow>>,
}

/// Goes through a route; where steps are identified together their errors are the open ones. `dwells_s`: one for each visit; where there are none, a method that looks at each step by itself gets
/// the shortest that reaches the required error, and any other the request's.
pub(crate) fn walk(
    request: &PlanRequest<'_>,
    route: Route<'_>,
    dwells_s: Option<&[f64]>,
) -> Result<Walk, PlanError> {
    // Repeats compare when they last equally long: the first one's dwell holds for all.
    let mut repeat_dwell_s = None;
    let mut steps: Vec<PlanStep> = Vec::with_capacity(route.visits.len());
    let mut rows = Vec::new();
    let mut forbidden = Vec::new();
    let mut start_s = request.timing.warm_up_s;
    let mut now: Option<(State, usize)> = None;
    for visit in route.visits {
        let (to, target) = (route.points[visit.index], &route.targets[visit.index]);
        let fail = |source| PlanError::Forecast { to, source };
        let state = match now {
            Some((state, _)) => state,
            None => warmed_up(request.model, target.state, &target.boundary, request.timing.warm_up_s)
                .map_err(fail)?,
        };
        let is_repeat = visit.kind == StepKind::Repeat && Some(visit.index) == route.repeated;
        let given_s = dwells_s
            .and_then(|dwells_s| dwells_s.get(steps.len()).copied())
            .or(repeat_dwell_s.filter(|_| is_repeat));
        let (dwell_s, forecast) = match given_s {
            Some(dwell_s) => {
                (dwell_s, forecast(request, state, &target.boundary, dwell_s, now.is_some()).map_err(fail)?)
            }
            None => step(request, state, target, now.is_some()).map_err(fail)?,
        };
        if is_repeat {
            repeat_dwell_s = Some(dwell_s);
        }
        if let Some((_, from)) = now {
            let p3_change_pa = target.boundary.p3_pa - route.targets[from].boundary.p3_pa;
            let reasons = rejections(request, &forecast, p3_change_pa, target.boundary.t3_k);
            if !reasons.is_empty() {
                let reasons = reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join(", and ");
                forbidden.push(Forbidden { from, to: visit.index, reasons });
            }
        }
        steps.push(PlanStep {
            index: steps.len(),
            kind: visit.kind,
            from: now.map(|(_, from)| route.points[from]),
            to,
            p3_pa: target.boundary.p3_pa,
            t3_k: target.boundary.t3_k,
            oil_temperature_k: target.boundary.oil_temperature_k,
            dwell_s,
            start_s,
            predicted: forecast.predicted,
        });
        start_s += dwell_s;
        now = Some((forecast.end, visit.index));
        rows.push(forecast.rows);
    }
    with_errors_together(request, &rows, steps.iter_mut().map(|step| &mut step.predicted), false);
    Ok(Walk { steps, forbidden, rows })
}

impl Walk {
    /// With the errors of a machine that is as declared.
    pub(crate) fn thorough(mut self, request: &PlanRequest<'_>) -> Self {
        let predicted = self.steps.iter_mut().map(|step| &mut step.predicted);
        with_errors_together(request, &self.rows, predicted, true);
        self
    }
}

/// A step with its dwell: the request's, or the shortest that reaches the required error.
fn step(
    request: &PlanRequest<'_>,
    state: State,
    target: &SteadyState,
    has_jump: bool,
) -> Result<(f64, Forecast), SimulationError> {
    let longest_s = request.timing.dwell_s;
    let at = |dwell_s: f64| forecast(request, state, &target.boundary, dwell_s, has_jump);
    let by_itself = request.method.is_some_and(|method| !method.is_joint());
    if let (true, Some(required), true) = (by_itself, request.required_sigma_eta, has_jump) {
        let mut dwell_s = SHORTEST_DWELL_S;
        while dwell_s < longest_s {
            let forecast = at(dwell_s)?;
            if error_eta(&forecast.predicted).is_some_and(|error| error <= required) {
                return Ok((dwell_s, forecast));
            }
            dwell_s += DWELL_STEP_S;
        }
    }
    Ok((longest_s, at(longest_s)?))
}
