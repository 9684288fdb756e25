//! What no order can know better than, under a method that looks at all steps together.
//!
//! The method says what each step counts for along the tangent of the variances at the plan ([`ErrorTangent`]): a sum over steps,
//! which no order's variances lie below. What a step to a point counts for depends on the temperatures before it, and these lie in
//! the box that a dwell at the point before ends in; the most over that box makes a weight for each jump, and the best
//! assignment of successors a sum that no order exceeds, as for gradients (`bound.rs`).

use crate::assignment::largest_assignment;
use crate::bound::{EXACT_POINTS, reachable_boxes};
use crate::chain::Chain;
use crate::forecast::forecast;
use crate::housing::{Housing, PERCENT2};
use crate::method::{ErrorTangent, ForecastRow};
use crate::reach::reachable;
use crate::request::{PlanError, PlanRequest};
use crate::retimed::along;
use mapper_core::{OperatingPoint, Plan, PlanErrorBound, StepKind};
use mapper_numerics::parallel;
use mapper_physics::forecast::warmed_up;
use mapper_physics::steady::SteadyState;

/// A place where the machine comes by: a point for its dwell, or the end of a repeat for that of repeats.
#[derive(Debug, Clone, Copy)]
struct Node {
    point: OperatingPoint,
    dwell_s: f64,
    /// The plan's step there.
    step: usize,
    is_repeat: bool,
}

/// How many times as much the steps of the campaigns tell at which tangents are laid: the best of the bounds is taken.
const TIMES: [f64; 4] = [1.5, 2.5, 4.0, 6.0];

/// By the information of all steps, the error of a plan and what no other order of its points, each for the same dwell, is below.
/// `None` where the method knows no tangent, above 500 steps, and where the housing stays within no box.
///
/// # Errors
/// [`PlanError`] where a simulation fails.
pub fn error_bound(request: &PlanRequest<'_>, plan: &Plan) -> Result<Option<PlanErrorBound>, PlanError> {
    let Some(method) = request.method.filter(|_| (3..=EXACT_POINTS).contains(&plan.steps.len())) else {
        return Ok(None);
    };
    // The method is asked through its tangents alone.
    let plain = &PlanRequest { method: None, ..request.clone() };
    let mut rows: Vec<Vec<ForecastRow>> = Vec::with_capacity(plan.steps.len());
    along(plain, plan, |state, boundary, step| {
        let mut found = forecast(plain, state, boundary, step.dwell_s, step.from.is_some())?;
        rows.push(std::mem::take(&mut found.rows));
        Ok(found)
    })?;
    let rows: Vec<&[ForecastRow]> = rows.iter().map(Vec::as_slice).collect();
    let measures: Vec<bool> = plan.steps.iter().map(|step| step.kind.measures()).collect();
    let tangent = |times: f64| method.tangent_at(&rows, &measures, times);
    let own = |tangent: &dyn ErrorTangent| {
        rows.iter().enumerate().map(|(place, rows)| tangent.of(rows, place)).collect::<Option<Vec<f64>>>()
    };
    let Some(here) = tangent(1.0) else { return Ok(None) };
    let Some(counted) = own(here.as_ref()) else { return Ok(None) };
    let variances = here.start() - counted.iter().sum::<f64>();
    let mut least: Option<f64> = None;
    for tangent in TIMES.into_iter().filter_map(tangent) {
        let Some(own) = own(tangent.as_ref()) else { continue };
        let most = most_counted(plain, plan, tangent.as_ref(), &own)?;
        least = most.map(|most| tangent.start() - most).into_iter().chain(least).reduce(f64::max);
    }
    let measured = measures.iter().filter(|measures| **measures).count() as f64;
    let rms = |sum: f64| (sum.max(0.0) / measured).sqrt();
    Ok(least.map(|least| PlanErrorBound { error_eta: rms(variances), least_error_eta: rms(least) }))
}

/// The most that the steps of any order count for along a tangent, fraction^2; `own`: what those of the plan do.
fn most_counted(
    request: &PlanRequest<'_>,
    plan: &Plan,
    tangent: &dyn ErrorTangent,
    own: &[f64],
) -> Result<Option<f64>, PlanError> {
    let nodes = nodes(plan);
    let points: Vec<OperatingPoint> = nodes.iter().map(|node| node.point).collect();
    let dwells_s: Vec<f64> = nodes.iter().map(|node| node.dwell_s).collect();
    let targets = reachable(request, &points)?;
    let counts = |node: usize, rows: &[ForecastRow]| tangent.of(rows, nodes[node].step);
    let housing = Housing::of_dwells(request, &points, &targets, None, &dwells_s, Some(&counts))?;
    let Some(weights) = Weights::of(&housing, &nodes) else { return Ok(None) };
    let Some(first) = most_of_first(request, plan, (&nodes, &targets), tangent)? else { return Ok(None) };
    // Of the reduced housing; what the full model gives more along this plan is added to it.
    let more = own[1..].iter().sum::<f64>() - along_plan(&housing, plan, &nodes) / PERCENT2;
    let jumps = (weights.of_points(returns(plan)) + weights.of_repeats(plan)) / PERCENT2;
    Ok(Some(first + jumps + more.max(0.0)))
}

/// The most that a first step, which no jump leads to, counts for at any point.
fn most_of_first(
    request: &PlanRequest<'_>,
    plan: &Plan,
    (nodes, targets): (&[Node], &[SteadyState]),
    tangent: &dyn ErrorTangent,
) -> Result<Option<f64>, PlanError> {
    let Some(planned) = plan.steps.first() else { return Ok(None) };
    let starts: Vec<(&Node, &SteadyState)> =
        nodes.iter().zip(targets).filter(|(node, _)| !node.is_repeat).collect();
    let counts = |(node, target): &(&Node, &SteadyState)| {
        let state = warmed_up(request.model, target.state, &target.boundary, plan.warm_up_s)?;
        // Where the order returns to its point, it measures that point a second time.
        let place = if returns(plan) { 0 } else { node.step };
        let first = forecast(request, state, &target.boundary, planned.dwell_s, false)?;
        Ok(tangent.of(&first.rows, place))
    };
    let fail = |source| PlanError::Forecast { to: planned.to, source };
    let counted: Option<Vec<f64>> = parallel::try_map(&starts, counts).map_err(fail)?.into_iter().collect();
    Ok(counted.and_then(|counted| counted.into_iter().reduce(f64::max)))
}

fn returns(plan: &Plan) -> bool {
    plan.steps.iter().any(|step| step.kind == StepKind::Return)
}

/// Each point once, by the step that a jump leads to where there is one, then each end of a repeat.
fn nodes(plan: &Plan) -> Vec<Node> {
    let mut nodes: Vec<Node> = Vec::new();
    for is_repeat in [false, true] {
        for (place, step) in
            plan.steps.iter().enumerate().filter(|(_, step)| step.kind.measures() != is_repeat)
        {
            let node = Node { point: step.to, dwell_s: step.dwell_s, step: place, is_repeat };
            match nodes.iter_mut().find(|other| other.point == node.point && other.is_repeat == is_repeat) {
                Some(known) if !is_repeat => *known = node,
                Some(_) => {}
                None => nodes.push(node),
            }
        }
    }
    nodes
}

/// The node of a step.
fn node_of(nodes: &[Node], plan: &Plan, place: usize) -> Option<usize> {
    let step = plan.steps.get(place)?;
    nodes.iter().position(|node| node.point == step.to && node.is_repeat != step.kind.measures())
}

/// What the plan's jumps count for by the reduced housing.
fn along_plan(housing: &Housing, plan: &Plan, nodes: &[Node]) -> f64 {
    let visited: Vec<usize> = (0..plan.steps.len()).filter_map(|place| node_of(nodes, plan, place)).collect();
    let Some(&first) = visited.first() else { return 0.0 };
    let mut state = housing.first_state(first);
    let mut sum = 0.0;
    for pair in visited.windows(2) {
        sum += housing.worth(pair[0], pair[1], state).unwrap_or(0.0);
        state = housing.step(pair[0], pair[1], state).1;
    }
    sum
}

/// The most that a step between two nodes can count for.
struct Weights<'a> {
    nodes: &'a [Node],
    points: usize,
    table: Vec<f64>,
}

impl<'a> Weights<'a> {
    fn of(housing: &Housing, nodes: &'a [Node]) -> Option<Self> {
        let all: Vec<usize> = (0..nodes.len()).collect();
        let boxes = reachable_boxes(housing, &all)?;
        let mut table = vec![f64::NEG_INFINITY; nodes.len() * nodes.len()];
        for (from, (c, t)) in boxes.iter().enumerate() {
            for to in all.iter().copied().filter(|to| nodes[*to].point != nodes[from].point) {
                table[nodes.len() * from + to] = housing.most_worth(from, to, (*c, *t))?;
            }
        }
        Some(Weights { nodes, points: nodes.iter().filter(|node| !node.is_repeat).count(), table })
    }

    fn weight(&self, from: usize, to: usize) -> f64 {
        self.table[self.nodes.len() * from + to].max(NEVER)
    }

    /// The most that the jumps to all points count for; a repeat's end may lie before any of them. `returns`: the order ends with a
    /// jump back to its first point.
    fn of_points(&self, returns: bool) -> f64 {
        // Without a way back one node more closes the path to a circle: the first point follows it, and it follows the last.
        let (points, all) = (self.points, self.nodes.len());
        let size = points + usize::from(!returns);
        // Before a point there is another, or where repeats end.
        let into = |to: usize, from: usize| {
            (points..all).map(|repeat| self.weight(repeat, to)).fold(self.weight(from, to), f64::max)
        };
        largest_assignment(size, |from, to| match (from < points, to < points) {
            (true, true) if from == to => self.weight_after_repeat(to),
            (true, true) => into(to, from),
            (true, false) | (false, true) => 0.0,
            (false, false) => NEVER,
        })
    }

    /// The most that the jump from a repeat's end to a point counts for.
    fn weight_after_repeat(&self, to: usize) -> f64 {
        (self.points..self.nodes.len()).map(|repeat| self.weight(repeat, to)).fold(NEVER, f64::max)
    }

    /// The most that the plan's repeats count for, wherever they are put.
    fn of_repeats(&self, plan: &Plan) -> f64 {
        let is_repeat = |place: usize| plan.steps.get(place).is_some_and(|step| !step.kind.measures());
        let repeats = || (0..plan.steps.len()).filter(|place| is_repeat(*place));
        // A repeat is the jump from its start, which may take a step of its own, to its end.
        let Some(end) = repeats().find(|place| !is_repeat(place + 1)).map(|place| &plan.steps[place]) else {
            return 0.0;
        };
        let most = |place: usize| {
            let to = node_of(self.nodes, plan, place)?;
            let leads = |node: &Node| self.nodes[to].point != end.to || Some(node.point) == end.from;
            let starts = (0..self.nodes.len()).filter(|from| leads(&self.nodes[*from]));
            Some(starts.map(|from| self.weight(from, to)).fold(NEVER, f64::max))
        };
        repeats().filter_map(most).sum()
    }
}

/// What stands for a jump that is none: the assignment needs finite weights.
const NEVER: f64 = -1e9;
