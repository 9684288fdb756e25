//! From a request to a plan.

use crate::bound::Optimistic;
use crate::fingerprint::made_from;
use crate::forecast::{Forecast, forecast};
use crate::graph::rejections;
use crate::housing::Housing;
use crate::order::{Ordered, PROOF_TOLERANCE_RATIO, objective, order_on};
use crate::reach::reachable;
use crate::repeats::{RepeatedJump, Visit, append, plain, put_return, usual_jumps, with_repeats};
use crate::request::{PlanError, PlanRequest};
use mapper_core::{
    Jump, OperatingPoint, Plan, PlanBound, PlanFigures, PlanStep, Repeats, StepKind, VisitOrder, WindowRule,
};
use mapper_numerics::statistics::rms;
use mapper_physics::forecast::warmed_up;
use mapper_physics::model::State;
use mapper_physics::steady::SteadyState;

/// How often jumps that turn out not to be allowed are taken out and the rest is ordered again.
const ROUNDS: usize = 25;
/// Jumps tried for repeats where the request names none.
const USUAL_JUMPS: usize = 3;
/// Dwells tried for the shortest campaign lie this far apart, s.
const DWELL_STEP_S: f64 = 5.0;
/// Shortest of them, s: the earliest window with the shortest useful length.
const SHORTEST_DWELL_S: f64 = WindowRule::EARLIEST_S + WindowRule::SHORTEST_S;

/// Orders the points and forecasts every step.
///
/// # Errors
/// [`PlanError`] with all unreachable points, all limits in their way, or the step whose forecast failed.
pub fn make_plan(request: &PlanRequest<'_>) -> Result<Plan, PlanError> {
    if request.points.is_empty() {
        return Err(PlanError::NoPoints);
    }
    if request.order.needs_method() && request.method.is_none() {
        return Err(PlanError::NeedsMethod { order: request.order.name() });
    }
    if request.order == VisitOrder::Time && request.required_sigma_eta.is_none() {
        return Err(PlanError::NeedsRequiredError);
    }
    let targets = reachable(request, request.points)?;
    let made = plan_to(request, &targets);
    let (true, Err(PlanError::NoAdmissibleOrder(_))) = (request.return_to_first, &made) else { return made };
    // It may be the way back alone that is not allowed: nobody asked for it by name.
    let mut plan = plan_to(&PlanRequest { return_to_first: false, ..request.clone() }, &targets)?;
    plan.remarks.push("a limit forbids the way back to the first point at the end".to_owned());
    Ok(plan)
}

/// The plan with the repeats that the request asks for. `targets`: the steady states of its points.
fn plan_to(request: &PlanRequest<'_>, targets: &[SteadyState]) -> Result<Plan, PlanError> {
    let Some(repeats) = request.repeats else { return plan_with(request, targets, None) };
    if let Some(jump) = repeats.jump {
        return plan_with(request, targets, Some((repeats, jump)));
    }
    let mut barred = None;
    for jump in usual_jumps(request, targets)?.into_iter().take(USUAL_JUMPS) {
        match plan_with(request, targets, Some((repeats, jump))) {
            // It may be the repeated jump itself that is not allowed from where the machine comes to it.
            Err(error @ PlanError::NoAdmissibleOrder(_)) => barred = Some(error),
            made => return made,
        }
    }
    let mut plan = plan_with(request, targets, None).map_err(|error| barred.unwrap_or(error))?;
    plan.remarks.push("no jump between the points can be repeated, so that drift would not show".to_owned());
    Ok(plan)
}

/// The plan with one jump repeated, or none. `reached`: the steady states of the request's points.
fn plan_with(
    request: &PlanRequest<'_>,
    reached: &[SteadyState],
    repeats: Option<(Repeats, Jump)>,
) -> Result<Plan, PlanError> {
    let needs_method = request.order.needs_method();
    let (mut points, mut targets) = (request.points.to_vec(), reached.to_vec());
    let mut repeated = None;
    let mut place = |point: OperatingPoint| -> Result<usize, PlanError> {
        if let Some(known) = points.iter().position(|other| *other == point) {
            return Ok(known);
        }
        targets.extend(reachable(request, &[point])?);
        points.push(point);
        Ok(points.len() - 1)
    };
    if let Some((repeats, Jump { from, to })) = repeats {
        let (from, to) = (place(from)?, place(to)?);
        repeated =
            Some(RepeatedJump { from, to, every_steps: repeats.every_steps, at_least: repeats.at_least });
    }
    let appended =
        request.appended.map(|jump| Ok::<_, PlanError>((place(jump.from)?, place(jump.to)?))).transpose()?;
    // Only the search for information needs the method at every start of the reduced housing.
    let without_method = PlanRequest { method: request.method.filter(|_| needs_method), ..request.clone() };
    let mut housing = Housing::of(&without_method, &points, &targets, None)?;
    housing.returns = request.return_to_first;
    let given: Vec<usize> = (0..request.points.len()).collect();
    let mut barred: Vec<String> = Vec::new();
    for _ in 0..ROUNDS {
        let ordered = order_on(&housing, &given, request);
        let mut visits = match repeated {
            Some(jump) => with_repeats(&housing, &ordered.order, jump, objective(request.order)),
            None => plain(&ordered.order),
        };
        let returned = request.return_to_first && put_return(&mut visits);
        if let Some((from, to)) = appended {
            append(&mut visits, from, to);
        }
        let (steps, forbidden) = walk(request, &points, &targets, &visits, repeated.map(|jump| jump.to))?;
        if forbidden.is_empty() {
            // What was searched, proven and bounded is an order with its way back.
            let proven = ordered.proven && (returned || !request.return_to_first || given.len() < 2);
            let ordered = Ordered { proven, ..ordered };
            return Ok(finished(request, &housing, &ordered, &visits, repeated, steps));
        }
        let before = barred.len();
        for Forbidden { from, to, reasons } in forbidden {
            let text = format!("{} to {}: {reasons}", points[from], points[to]);
            if !barred.contains(&text) {
                barred.push(text);
            }
            housing.forbid(from, to);
        }
        let searched = !matches!(request.order, VisitOrder::Listed);
        if barred.len() == before || !searched {
            break;
        }
    }
    Err(PlanError::NoAdmissibleOrder(barred))
}

/// A jump of a plan that is not allowed.
struct Forbidden {
    from: usize,
    to: usize,
    reasons: String,
}

/// The steps in full, and the jumps among them that are not allowed.
fn walk(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
    targets: &[SteadyState],
    visits: &[Visit],
    repeated: Option<usize>,
) -> Result<(Vec<PlanStep>, Vec<Forbidden>), PlanError> {
    // Repeats compare when they last equally long: the first one's dwell holds for all.
    let mut repeat_dwell_s = None;
    let mut steps: Vec<PlanStep> = Vec::with_capacity(visits.len());
    let mut forbidden = Vec::new();
    let mut start_s = request.timing.warm_up_s;
    let mut now: Option<(State, usize)> = None;
    for visit in visits {
        let (to, target) = (points[visit.index], &targets[visit.index]);
        let fail = |source| PlanError::Forecast { to, source };
        let state = match now {
            Some((state, _)) => state,
            None => warmed_up(request.model, target.state, &target.boundary, request.timing.warm_up_s)
                .map_err(fail)?,
        };
        let is_repeat = visit.kind == StepKind::Repeat && Some(visit.index) == repeated;
        let (dwell_s, forecast) = match repeat_dwell_s.filter(|_| is_repeat) {
            Some(dwell_s) => {
                (dwell_s, forecast(request, state, &target.boundary, dwell_s, now.is_some()).map_err(fail)?)
            }
            None => step(request, state, target, now.is_some()).map_err(fail)?,
        };
        if is_repeat {
            repeat_dwell_s = Some(dwell_s);
        }
        if let Some((_, from)) = now {
            let p3_change_pa = target.boundary.p3_pa - targets[from].boundary.p3_pa;
            let reasons = rejections(request, &forecast, p3_change_pa, target.boundary.t3_k);
            if !reasons.is_empty() {
                let reasons = reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join(", and ");
                forbidden.push(Forbidden { from, to: visit.index, reasons });
            }
        }
        steps.push(PlanStep {
            index: steps.len(),
            kind: visit.kind,
            from: now.map(|(_, from)| points[from]),
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
    }
    Ok((steps, forbidden))
}

/// A step with its dwell: the request's, or the shortest that reaches the required error.
fn step(
    request: &PlanRequest<'_>,
    state: State,
    target: &SteadyState,
    has_jump: bool,
) -> Result<(f64, Forecast), mapper_physics::simulate::SimulationError> {
    let longest_s = request.timing.dwell_s;
    let at = |dwell_s: f64| forecast(request, state, &target.boundary, dwell_s, has_jump);
    if let (VisitOrder::Time, Some(required), true) = (request.order, request.required_sigma_eta, has_jump) {
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

/// Standard error and bias of the efficiency in quadrature.
fn error_eta(predicted: &mapper_core::Predicted) -> Option<f64> {
    Some(predicted.sigma_eta?.hypot(predicted.bias_eta.unwrap_or(0.0)))
}

fn finished(
    request: &PlanRequest<'_>,
    housing: &Housing,
    ordered: &Ordered,
    visits: &[Visit],
    repeated: Option<RepeatedJump>,
    steps: Vec<PlanStep>,
) -> Plan {
    let repeated_to = visits
        .iter()
        .zip(&steps)
        .find(|(visit, _)| Some(visit.index) == repeated.map(|jump| jump.to))
        .map(|(_, step)| step.to);
    let duration_s = request.timing.warm_up_s
        + steps.iter().map(|step| step.dwell_s).sum::<f64>()
        + request.timing.cool_down_s;
    let figures = figures(&steps, duration_s / 60.0);
    // A bound holds for the points and their repeats, not for what is put behind them.
    let searched =
        !matches!(request.order, VisitOrder::Listed | VisitOrder::Greedy) && request.appended.is_none();
    let bound =
        searched.then(|| bound(request, housing, ordered, visits, repeated, &steps, &figures)).flatten();
    Plan {
        campaign: request.campaign_name.to_owned(),
        objective: request.order.name().to_owned(),
        seed: request.seed,
        made_from: made_from(request),
        warm_up_s: request.timing.warm_up_s,
        cool_down_s: request.timing.cool_down_s,
        remarks: remarks(request, &steps, repeated_to),
        figures,
        bound_remark: bound_remark(request, bound.as_ref()),
        bound,
        steps,
    }
}

/// What is not known of how good an order could be.
fn bound_remark(request: &PlanRequest<'_>, bound: Option<&PlanBound>) -> Option<String> {
    if request.appended.is_some() {
        return Some("none was worked out: a jump was put behind the points".to_owned());
    }
    let text = match request.order {
        VisitOrder::Listed | VisitOrder::Greedy => "the order was not searched for",
        VisitOrder::Time => {
            "none is known for the shortest campaign: each dwell is chosen for itself, and bounds hold for one dwell alone"
        }
        VisitOrder::Information => {
            "none is known for the predicted error of the efficiency; those of the gradients hold for any order"
        }
        VisitOrder::SumGradient | VisitOrder::WorstGradient if bound.is_none() => {
            "none was worked out: more points than the bound's table takes, or a housing that stays within no box"
        }
        VisitOrder::SumGradient | VisitOrder::WorstGradient => return None,
    };
    Some(text.to_owned())
}

fn remarks(request: &PlanRequest<'_>, steps: &[PlanStep], repeated: Option<OperatingPoint>) -> Vec<String> {
    let mut remarks = Vec::new();
    let repeats: Vec<&PlanStep> =
        steps.iter().filter(|step| step.kind == StepKind::Repeat && Some(step.to) == repeated).collect();
    if let Some(PlanStep { from: Some(from), to, .. }) = repeats.first() {
        remarks.push(format!("the jump from {from} to {to} is made {} times to show drift", repeats.len()));
    }
    if let Some(Jump { from, to }) = request.appended {
        remarks
            .push(format!("the jump from {from} to {to} is made after all else, and is no point of the map"));
    }
    if let Some(first) = steps.first() {
        let again = steps[1..].iter().any(|step| step.to == first.to);
        if steps.iter().any(|step| step.kind == StepKind::Return) {
            remarks.push(format!(
                "the first point, {}, is visited again at the end: no jump led to it at the start",
                first.to
            ));
        } else if !again {
            remarks.push(format!(
                "no jump leads to the first point, {}: it has no transient to identify",
                first.to
            ));
        }
    }
    if let (VisitOrder::Time, Some(required)) = (request.order, request.required_sigma_eta) {
        let short: Vec<String> = steps
            .iter()
            .filter(|step| error_eta(&step.predicted).is_some_and(|error| error > required))
            .map(|step| step.to.to_string())
            .collect();
        if !short.is_empty() {
            remarks.push(format!(
                "{} of the steps do not reach an error of {:.2} points of efficiency within {:.0} s: {}",
                short.len(),
                100.0 * required,
                request.timing.dwell_s,
                short.join(", ")
            ));
        }
    }
    remarks
}

fn bound(
    request: &PlanRequest<'_>,
    housing: &Housing,
    ordered: &Ordered,
    visits: &[Visit],
    repeated: Option<RepeatedJump>,
    steps: &[PlanStep],
    figures: &PlanFigures,
) -> Option<PlanBound> {
    // A dwell of its own for each step is another problem than the one the housing was reduced for.
    if request.order == VisitOrder::Time {
        return None;
    }
    let mut nodes: Vec<usize> = ordered.order.clone();
    let returns = visits.iter().any(|visit| visit.kind == StepKind::Return);
    let copies = visits.iter().filter(|visit| visit.kind == StepKind::Repeat).count();
    let counted = nodes.len();
    let place = repeated.map(|jump| {
        // Both ends of the jump, where they are not points of the grid: the housing comes by there too.
        let mut place = 0;
        for end in [jump.from, jump.to] {
            place = nodes.iter().position(|node| *node == end).unwrap_or_else(|| {
                nodes.push(end);
                nodes.len() - 1
            });
        }
        place
    });
    let bound = Optimistic::of(housing, &nodes)?.bound(counted, place.map(|place| (place, copies)), returns);
    let order: Vec<usize> = visits.iter().map(|visit| visit.index).collect();
    let reduced_k = crate::chain::gradients_k(housing, &order);
    let full_k = steps.iter().skip(1).map(|step| step.predicted.dtc_k.unwrap_or(0.0).abs());
    let (mut sum_k, mut error_k) = (0.0, 0.0f64);
    for (full_k, reduced_k) in full_k.zip(&reduced_k) {
        sum_k += full_k - reduced_k;
        error_k = error_k.max((full_k - reduced_k).abs());
    }
    // The bound is one of the reduced housing; what the full model gives more along this plan is added to it.
    let (sum_bound_k, worst_bound_k) = (bound.sum_k + f64::max(sum_k, 0.0), bound.worst_k + error_k);
    let below = |figure: f64, bound: f64| (bound > 0.0).then(|| 100.0 * (1.0 - figure / bound));
    let gap_percent = match request.order {
        VisitOrder::SumGradient => below(figures.sum_gradient_k, sum_bound_k),
        VisitOrder::WorstGradient => figures.worst_gradient_k.and_then(|worst| below(worst, worst_bound_k)),
        _ => None,
    };
    Some(PlanBound {
        sum_gradient_k: sum_bound_k,
        worst_gradient_k: worst_bound_k,
        gap_percent,
        proven: ordered.proven,
        proof_tolerance_percent: ordered.proven.then_some(100.0 * PROOF_TOLERANCE_RATIO),
        model_error_k: error_k,
    })
}

/// The figures, of the steps that measure a point: a repeat is there to compare.
fn figures(steps: &[PlanStep], minutes: f64) -> PlanFigures {
    let points = || steps.iter().filter(|step| step.kind.measures()).map(|step| &step.predicted);
    let gradients = || points().filter_map(|predicted| predicted.dtc_k).map(f64::abs);
    let errors: Vec<f64> = points().filter_map(error_eta).collect();
    let largest = |values: &mut dyn Iterator<Item = f64>| values.max_by(f64::total_cmp);
    PlanFigures {
        sum_gradient_k: gradients().sum(),
        worst_gradient_k: gradients().min_by(f64::total_cmp),
        worst_sigma_eta: largest(&mut points().filter_map(|predicted| predicted.sigma_eta)),
        rms_error_eta: rms(&errors),
        worst_error_eta: largest(&mut errors.iter().copied()),
        minutes,
    }
}
