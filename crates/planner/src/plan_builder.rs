//! Builds a plan for a given dwell: order, repeats, ways around forbidden jumps, simulated steps, figures and remarks.

use crate::forecast::{Forecast, ParameterError, add_joint_errors, forecast};
use crate::housing::{Housing, RepeatedJump};
use crate::jump_forecast::{find_rejections, forecast_jumps};
use crate::jump_graph::{JumpGraph, Rejection};
use crate::request::{PlanError, PlanRequest, hash_inputs, solve_steady_states};
use crate::search::search_orders;
use crate::visits::{
    Visit, append_jump, append_return, insert_repeats, repeat_count, value, visits_of_points,
};
use mapper_core::{
    Dwell, Jump, OperatingPoint, Plan, PlanFigures, PlanRemark, PlanStep, Predicted, Repeats, StepKind,
    VisitOrder,
};
use mapper_numerics::statistics::rms;
use mapper_physics::operating_point::forecast::{hold, warm_up_state};
use mapper_physics::simulation::model::State;
use mapper_physics::simulation::steady::SteadyState;
use std::collections::BTreeSet;
use std::mem::discriminant;

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
        prior_sensitivity_eta: parameter_error.map(|parameter_error| parameter_error.eta),
        worst_error_eta: largest(&mut measured_steps(steps).filter_map(error_eta)),
        minutes,
    }
}

/// Maximum number of searches: each forbids the jumps that the full simulation rejected in the previous order.
const MAX_REORDERINGS: usize = 25;
/// Effort of a repeated search relative to the first: with one jump forbidden, the best order changes little.
const REORDER_EFFORT_RATIO: f64 = 0.2;

/// Maximum number of points for which all jumps are simulated to find ways around forbidden ones: some seconds.
const MAX_GRAPH_POINTS: usize = 100;

/// Maximum number of steps of a plan without ways around forbidden jumps: each repeat and the appended jump take at most two.
pub fn max_steps(request: &PlanRequest<'_>) -> usize {
    let points = request.points.len();
    let repeats = request.repeats.map_or(0, |repeats| 2 * repeat_count(repeats, points));
    let appended = if request.appended.is_some() { 2 } else { 0 };
    points + repeats + appended + usize::from(request.return_to_first && points > 1)
}

/// Builds plans of the same points for any dwell.
pub(crate) struct PlanBuilder<'a> {
    request: &'a PlanRequest<'a>,
    /// The points of the request, then those of repeats and of the appended jump only.
    points: Vec<OperatingPoint>,
    targets: Vec<SteadyState>,
    repeated: Option<RepeatedJump>,
    appended: Option<(usize, usize)>,
    /// Whether a way over other points may replace a forbidden jump.
    ways_around: bool,
}

/// A forbidden jump of an order, and the points over which the plan leads instead.
#[derive(Debug, Clone, PartialEq)]
struct WayAround {
    jump: Jump,
    over: Vec<OperatingPoint>,
}

/// An order of the points with its simulated steps.
pub(crate) struct Draft {
    /// Dwell of each step, s; the minimum dwell in conventional mapping.
    pub(crate) dwell_s: f64,
    visits: Vec<Visit>,
    ways_around: Vec<WayAround>,
    steps: Vec<PlanStep>,
    parameter_error: Option<ParameterError>,
}

impl Draft {
    pub(crate) fn steps(&self) -> &[PlanStep] {
        &self.steps
    }

    /// Whether a method that identifies all steps together has predicted errors.
    pub(crate) fn is_predicted(&self) -> bool {
        self.parameter_error.is_some()
    }
}

impl<'a> PlanBuilder<'a> {
    /// `targets`: the steady states of the request's points.
    pub(crate) fn new(
        request: &'a PlanRequest<'a>,
        targets: &[SteadyState],
        repeats: Option<(Repeats, Jump)>,
        ways_around: bool,
    ) -> Result<Self, PlanError> {
        let (points, targets) = (request.points.to_vec(), targets.to_vec());
        let mut builder =
            PlanBuilder { request, points, targets, repeated: None, appended: None, ways_around };
        if let Some((repeats, Jump { from, to })) = repeats {
            let (from, to) = (builder.index_of(from)?, builder.index_of(to)?);
            builder.repeated =
                Some(RepeatedJump { from, to, count: repeat_count(repeats, request.points.len()) });
        }
        if let Some(Jump { from, to }) = request.appended {
            builder.appended = Some((builder.index_of(from)?, builder.index_of(to)?));
        }
        Ok(builder)
    }

    fn index_of(&mut self, point: OperatingPoint) -> Result<usize, PlanError> {
        if let Some(known) = self.points.iter().position(|other| *other == point) {
            return Ok(known);
        }
        self.targets.extend(solve_steady_states(self.request, &[point])?);
        self.points.push(point);
        Ok(self.points.len() - 1)
    }

    /// Searches the best order for steps of `dwell_s`.
    pub(crate) fn draft(&self, dwell_s: f64) -> Result<Draft, PlanError> {
        let request = self.request;
        let mut housing = Housing::new(request, &self.points, &self.targets, dwell_s)?;
        housing.has_return = request.return_to_first;
        if self.ways_around && self.points.len() <= MAX_GRAPH_POINTS {
            return self.draft_with_ways_around(housing, dwell_s);
        }
        let mut given: Vec<usize> = (0..request.points.len()).collect();
        let mut forbidden_jumps: BTreeSet<(usize, usize)> = BTreeSet::new();
        let mut worst: Vec<(Jump, Rejection)> = Vec::new();
        for round in 0..MAX_REORDERINGS {
            let effort = if round == 0 { request.effort } else { REORDER_EFFORT_RATIO * request.effort };
            let orders =
                search_orders(&housing, &self.points, &given, &PlanRequest { effort, ..request.clone() });
            let Some((order, visits)) = self.best_of(&housing, orders) else { break };
            let Walk { steps, forbidden, parameter_error } =
                walk(request, &self.points, &self.targets, &visits, dwell_s)?;
            if forbidden.is_empty() {
                return Ok(Draft { dwell_s, visits, ways_around: Vec::new(), steps, parameter_error });
            }
            let before = forbidden_jumps.len();
            for ForbiddenJump { from, to, reasons } in forbidden {
                forbidden_jumps.insert((from, to));
                housing.forbid(from, to);
                let jump = Jump { from: self.points[from], to: self.points[to] };
                reasons.into_iter().for_each(|reason| keep_worst(&mut worst, jump, reason));
            }
            given = order;
            if forbidden_jumps.len() == before || request.order != VisitOrder::ThermalGradient {
                break;
            }
        }
        Err(PlanError::NoAdmissibleOrder { jumps: forbidden_jumps.len(), worst })
    }

    /// Searches the order with the fewest forbidden jumps, and leads around each of them on the shortest way over other points.
    fn draft_with_ways_around(&self, mut housing: Housing, dwell_s: f64) -> Result<Draft, PlanError> {
        let request = self.request;
        let mut graph = JumpGraph::complete(&self.points);
        for ((from, to), jump) in forecast_jumps(request, &self.points, &self.targets, dwell_s)? {
            graph.forbid(from, to, &jump.rejections);
        }
        let ranks = graph.ranks().map_err(PlanError::SeparatePoints)?;
        graph.forbidden().for_each(|(from, to)| housing.forbid(from, to));
        let given: Vec<usize> = (0..request.points.len()).collect();
        let mut orders = search_orders(&housing, &self.points, &given, request);
        for order in &mut orders {
            order.sort_by_key(|point| ranks[*point]);
        }
        let (_, direct) = self.best_of(&housing, orders).ok_or(PlanError::NoPoints)?;
        let mut worst: Vec<(Jump, Rejection)> = Vec::new();
        while let Some((visits, ways_around)) = self.lead_around(&graph, &direct) {
            let Walk { steps, forbidden, parameter_error } =
                walk(request, &self.points, &self.targets, &visits, dwell_s)?;
            if forbidden.is_empty() {
                return Ok(Draft { dwell_s, visits, ways_around, steps, parameter_error });
            }
            let mut is_new = false;
            for ForbiddenJump { from, to, reasons } in forbidden {
                is_new |= graph.forbid(from, to, &reasons);
                let jump = Jump { from: self.points[from], to: self.points[to] };
                reasons.into_iter().for_each(|reason| keep_worst(&mut worst, jump, reason));
            }
            if !is_new {
                break;
            }
        }
        Err(PlanError::NoAdmissibleOrder { jumps: graph.forbidden().count(), worst })
    }

    /// The visits with a way over other points in place of each forbidden jump. `None` if there is no such way, or if the jump is one that
    /// the plan has to make: the repeated or the appended one.
    fn lead_around(&self, graph: &JumpGraph, direct: &[Visit]) -> Option<(Vec<Visit>, Vec<WayAround>)> {
        let required = [self.repeated.map(|jump| (jump.from, jump.to)), self.appended];
        let (mut visits, mut ways): (Vec<Visit>, Vec<WayAround>) = (Vec::new(), Vec::new());
        for visit in direct {
            if let Some(from) = visits.last().map(|last| last.index)
                && from != visit.index
                && !graph.is_allowed(from, visit.index)
            {
                if visit.kind == StepKind::Repeat && required.contains(&Some((from, visit.index))) {
                    return None;
                }
                let over = graph.points_between(from, visit.index)?;
                visits.extend(over.iter().map(|&index| Visit { index, kind: StepKind::Repeat }));
                let jump = Jump { from: self.points[from], to: self.points[visit.index] };
                ways.push(WayAround {
                    jump,
                    over: over.into_iter().map(|point| self.points[point]).collect(),
                });
            }
            visits.push(*visit);
        }
        Some((visits, ways))
    }

    /// The order with the highest value including repeats, and its visits.
    fn best_of(&self, housing: &Housing, orders: Vec<Vec<usize>>) -> Option<(Vec<usize>, Vec<Visit>)> {
        let with_visits = orders.into_iter().map(|order| {
            let visits = self.visits(housing, &order);
            (value(housing, &visits), (order, visits))
        });
        let better = |best: (f64, _), other: (f64, _)| if other.0 > best.0 { other } else { best };
        with_visits.reduce(better).map(|(_, best)| best)
    }

    fn visits(&self, housing: &Housing, order: &[usize]) -> Vec<Visit> {
        let mut visits = match self.repeated {
            Some(jump) => insert_repeats(housing, order, jump),
            None => visits_of_points(order),
        };
        if self.request.return_to_first {
            append_return(&mut visits);
        }
        if let Some((from, to)) = self.appended {
            append_jump(&mut visits, from, to);
        }
        visits
    }

    /// Simulates the same order with another dwell. Searches a new order if a limit forbids one of its jumps at that dwell.
    pub(crate) fn with_dwell(&self, draft: Draft, dwell_s: f64) -> Result<Draft, PlanError> {
        if draft.dwell_s == dwell_s {
            return Ok(draft);
        }
        let Walk { steps, forbidden, parameter_error } =
            walk(self.request, &self.points, &self.targets, &draft.visits, dwell_s)?;
        if !forbidden.is_empty() {
            return self.draft(dwell_s);
        }
        Ok(Draft { dwell_s, steps, parameter_error, ..draft })
    }

    pub(crate) fn plan(&self, draft: Draft) -> Result<Plan, PlanError> {
        let request = self.request;
        let timing = request.timing;
        let steps_s = draft.steps.iter().map(|step| step.dwell_s).sum::<f64>();
        let minutes = (timing.warm_up_s + steps_s + timing.cool_down_s) / 60.0;
        let figures = compute_figures(&draft.steps, minutes, draft.parameter_error);
        Ok(Plan {
            campaign: request.campaign_name.to_owned(),
            objective: request.order.name().to_owned(),
            seed: request.seed,
            made_from: hash_inputs(request),
            warm_up_s: timing.warm_up_s,
            cool_down_s: timing.cool_down_s,
            remarks: self.remarks(&draft),
            figures,
            steps: draft.steps,
            surge_search_s: 0.0,
        })
    }

    fn remarks(&self, draft: &Draft) -> Vec<PlanRemark> {
        let (request, steps) = (self.request, &draft.steps);
        let mut remarks = Vec::new();
        let repeated = self.repeated.map(|jump| self.points[jump.to]);
        let repeats =
            || steps.iter().filter(|step| step.kind == StepKind::Repeat && Some(step.to) == repeated);
        if let Some(PlanStep { from: Some(from), to, .. }) = repeats().next() {
            remarks.push(PlanRemark::RepeatedJump { from: *from, to: *to, times: repeats().count() });
        }
        remarks.extend(draft.ways_around.iter().map(|WayAround { jump, over }| PlanRemark::WayAround {
            from: jump.from,
            to: jump.to,
            over: over.clone(),
        }));
        if let Some(Jump { from, to }) = request.appended {
            remarks.push(PlanRemark::AppendedJump { from, to });
        }
        if let [first, others @ ..] = steps.as_slice() {
            if steps.iter().any(|step| step.kind == StepKind::Return) {
                remarks.push(PlanRemark::FirstPointAgain { point: first.to });
            } else if others.iter().all(|step| step.to != first.to) {
                remarks.push(PlanRemark::FirstPointWithoutJump { point: first.to });
            }
        }
        if let Some(ParameterError { eta, max_eta, .. }) =
            draft.parameter_error.filter(|parameter_error| parameter_error.eta > parameter_error.max_eta)
        {
            remarks.push(PlanRemark::PriorDominated { eta_error: eta, max_eta_error: max_eta });
        }
        if let (Dwell::RequiredSigmaEta(required), Some(found)) = (request.timing.dwell, rms_error_eta(steps))
            && found > required
        {
            remarks.push(PlanRemark::RequiredErrorNotReached {
                dwell_s: draft.dwell_s,
                eta_sigma: found,
                required_eta_sigma: required,
            });
        }
        remarks
    }
}

/// Adds a reason, or replaces the one of the same limit that is exceeded less.
fn keep_worst(worst: &mut Vec<(Jump, Rejection)>, jump: Jump, reason: Rejection) {
    match worst.iter_mut().find(|(_, known)| discriminant(known) == discriminant(&reason)) {
        Some((_, known)) if known.ratio() >= reason.ratio() => {}
        Some(known) => *known = (jump, reason),
        None => worst.push((jump, reason)),
    }
}

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
