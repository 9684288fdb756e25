//! From the steps of a plan to the plan: figures, bound, remarks.

use crate::bound::Optimistic;
use crate::dwell::REACHED_RATIO;
use crate::figures::{duration_s, error_eta, figures, open_rms_error_eta};
use crate::fingerprint::made_from;
use crate::housing::Housing;
use crate::order::{Ordered, PROOF_TOLERANCE_RATIO};
use crate::repeats::{RepeatedJump, Visit};
use crate::request::PlanRequest;
use mapper_core::{Jump, OperatingPoint, Plan, PlanBound, PlanFigures, PlanStep, StepKind, VisitOrder};

pub(crate) fn finished(
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
    let figures = figures(&steps, duration_s(request, &steps) / 60.0);
    // A bound holds for the points and their repeats, not for what is put behind them.
    let searched = !matches!(request.order, VisitOrder::Listed | VisitOrder::Greedy | VisitOrder::SpeedLines)
        && request.appended.is_none();
    let bound =
        searched.then(|| bound(request, housing, ordered, visits, repeated, &steps, &figures)).flatten();
    Plan {
        campaign: request.campaign_name.to_owned(),
        objective: request.order.name().to_owned(),
        seed: request.seed,
        made_from: made_from(request),
        warm_up_s: request.timing.warm_up_s,
        cool_down_s: request.timing.cool_down_s,
        remarks: remarks(request, ordered, &steps, repeated_to),
        figures,
        bound_remark: bound_remark(request, bound.as_ref()),
        bound,
        error_bound: None,
        steps,
        surge_search_s: 0.0,
    }
}

/// What is not known of how good an order could be.
fn bound_remark(request: &PlanRequest<'_>, bound: Option<&PlanBound>) -> Option<String> {
    if request.appended.is_some() {
        return Some("none was worked out: a jump was put behind the points".to_owned());
    }
    let text = match request.order {
        VisitOrder::Listed | VisitOrder::Greedy | VisitOrder::SpeedLines => "the order was not searched for",
        _ if request.required_sigma_eta.is_some() => {
            "none is known for the gradients: each dwell is chosen for itself, and their bounds hold for one dwell alone"
        }
        VisitOrder::Information | VisitOrder::Time | VisitOrder::Best => {
            "those of the gradients hold for any order"
        }
        VisitOrder::SumGradient | VisitOrder::WorstGradient if bound.is_none() => {
            "none was worked out: more points than the bound's table takes, or a housing that stays within no box"
        }
        VisitOrder::SumGradient | VisitOrder::WorstGradient => return None,
    };
    Some(text.to_owned())
}

/// How what is said of a share of the gradients begins.
const KEEPS: &str = "where all steps last equally long, the order keeps";

/// The plan without what it says of a share of the gradients: where a search only began with one, nobody asked for it.
pub fn without_share(mut plan: Plan) -> Plan {
    plan.remarks.retain(|remark| !remark.starts_with(KEEPS));
    plan
}

fn remarks(
    request: &PlanRequest<'_>,
    ordered: &Ordered,
    steps: &[PlanStep],
    repeated: Option<OperatingPoint>,
) -> Vec<String> {
    let mut remarks = Vec::new();
    if let (Some(ratio), Some(share)) = (ordered.gradient_ratio, request.gradient_share) {
        remarks.push(format!(
            "{KEEPS} {:.0} % of the largest sum of gradients, of which {:.0} % are asked for",
            1e2 * ratio,
            1e2 * share
        ));
    }
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
    remarks.extend(not_reached(request, steps));
    remarks
}

/// What of the required error is not reached within the longest dwell.
pub(crate) fn not_reached(request: &PlanRequest<'_>, steps: &[PlanStep]) -> Option<String> {
    let required = request.required_sigma_eta?;
    let (percent, longest_s) = (100.0 * required, request.timing.dwell_s);
    if request.method.is_some_and(|method| method.is_joint()) {
        let found = open_rms_error_eta(steps)?;
        return (found > REACHED_RATIO * required).then(|| {
            format!(
                "steps of up to {longest_s:.0} s reach an error of {:.2} points of efficiency (rms), not the {percent:.2} that are required",
                100.0 * found
            )
        });
    }
    let short: Vec<String> = steps
        .iter()
        .filter(|step| error_eta(&step.predicted).is_some_and(|error| error > required))
        .map(|step| step.to.to_string())
        .collect();
    (!short.is_empty()).then(|| {
        format!(
            "{} of the steps do not reach an error of {percent:.2} points of efficiency within {longest_s:.0} s: {}",
            short.len(),
            short.join(", ")
        )
    })
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
    if request.required_sigma_eta.is_some() {
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
