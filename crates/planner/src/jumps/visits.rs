//! The visits of a plan: its points in order, the repeats of one jump for drift, the return to the first point, an appended jump.

use crate::jumps::graph::jump;
use crate::ordering::objective::{NOT_ALLOWED, Objective};
use crate::request::{PlanError, PlanRequest};
use crate::thermal_memory::chain::{Chain, way_back};
use mapper_core::{Jump, OperatingPoint, Repeats, StepKind};
use mapper_physics::simulation::steady::SteadyState;

/// Jumps that are looked at for one that may be repeated; each takes a simulation.
const LOOKED_AT: usize = 24;

/// Up to this many points a repeat may go anywhere where no place near its own is allowed.
const FEW_POINTS: usize = 200;

/// A visit of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Visit {
    pub(crate) index: usize,
    pub(crate) kind: StepKind,
}

/// The repeated jump among the points of a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RepeatedJump {
    pub(crate) from: usize,
    pub(crate) to: usize,
    /// How often it is made.
    pub(crate) count: usize,
}

/// How often a jump is repeated among so many points: at both ends, and in between at the spacing or closer.
pub(crate) fn repeat_count(repeats: Repeats, points: usize) -> usize {
    (points.div_ceil(repeats.every_steps.max(1)) + 1).max(repeats.at_least).min(points.max(1))
}

/// Jumps that suit for repeats, best first, those alone that are allowed: far in speed at an opening in the middle, up
/// to the faster point, where the efficiency is sure.
pub(crate) fn usual_jumps(
    request: &PlanRequest<'_>,
    targets: &[SteadyState],
) -> Result<Vec<Jump>, PlanError> {
    let points = request.points;
    let mut openings: Vec<f64> = points.iter().map(|point| point.valve_opening_ratio).collect();
    openings.sort_by(f64::total_cmp);
    let Some(&middle) = openings.get(openings.len() / 2) else { return Ok(Vec::new()) };
    // Of each opening the slowest and the faster ones; a pair of openings where no opening has two speeds.
    let mut found: Vec<(usize, usize)> = Vec::new();
    openings.dedup();
    for opening in &openings {
        let of_opening = |i: &usize| points[*i].valve_opening_ratio == *opening;
        found.extend(from_slowest(points, (0..points.len()).filter(of_opening).collect()));
    }
    if found.is_empty() {
        found = from_slowest(points, (0..points.len()).collect());
    }
    let off_middle = |i: usize| (points[i].valve_opening_ratio - middle).abs();
    found.sort_by(|a, b| {
        let by_opening = off_middle(a.1).total_cmp(&off_middle(b.1));
        by_opening.then(points[b.1].speed_rpm.total_cmp(&points[a.1].speed_rpm)).then(a.cmp(b))
    });
    let mut allowed = Vec::new();
    for (from, to) in found.into_iter().take(LOOKED_AT) {
        let made = jump(request, (points[from], &targets[from]), (points[to], &targets[to]))?;
        if made.rejections.is_empty() {
            allowed.push(Jump { from: made.from, to: made.to });
        }
    }
    Ok(allowed)
}

/// From the slowest of some points to each faster one.
fn from_slowest(points: &[OperatingPoint], of: Vec<usize>) -> Vec<(usize, usize)> {
    let by_speed = |a: &usize, b: &usize| points[*a].speed_rpm.total_cmp(&points[*b].speed_rpm);
    let Some(slowest) = of.iter().copied().min_by(by_speed) else { return Vec::new() };
    let faster = |to: &usize| points[*to].speed_rpm > points[slowest].speed_rpm;
    of.into_iter().filter(faster).map(|to| (slowest, to)).collect()
}

/// An order without repeats.
pub(crate) fn plain(order: &[usize]) -> Vec<Visit> {
    order.iter().map(|&index| Visit { index, kind: StepKind::Point }).collect()
}

/// The order with the jump put in. Each repeat may move by a quarter of the spacing to where it adds fewer steps (none
/// but itself, where the order passes by its start), and among those to where the points lose least.
pub(crate) fn with_repeats<C: Chain>(
    chain: &C,
    order: &[usize],
    jump: RepeatedJump,
    objective: Objective,
) -> Vec<Visit> {
    let mut visits = plain(order);
    let (points, count) = (order.len(), jump.count);
    let spacing = points as f64 / (count.max(2) - 1) as f64;
    let slack = (spacing / 4.0).floor() as usize;
    let mut inserted = 0;
    for repeat in 0..count {
        // Counted in points of the order; at least one step comes before.
        let ideal = ((repeat as f64 * spacing).round() as usize).clamp(1, points);
        let before = value(chain, &visits, objective);
        let best_of = |places: std::ops::RangeInclusive<usize>| {
            // Not between the two ends of another repeat.
            let free =
                |place: &usize| visits.get(place + inserted).is_none_or(|next| next.kind == StepKind::Point);
            places
                .filter(free)
                .map(|place| {
                    let at = place + inserted;
                    let trial = put(&visits, at, jump);
                    let value = value(chain, &trial, objective);
                    // What is allowed first, then fewer steps.
                    let barred = value < before - 0.5 * NOT_ALLOWED;
                    ((barred, trial.len()), -value, place.abs_diff(ideal), trial)
                })
                .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)))
        };
        let near = best_of(ideal.saturating_sub(slack).max(1)..=(ideal + slack).min(points));
        let best = match near {
            // Farther off rather than not at all; behind the repeats before, which keep their order.
            Some(((true, _), ..)) if points <= FEW_POINTS => best_of(1..=points),
            near => near,
        };
        if let Some((.., trial)) = best {
            inserted += trial.len() - visits.len();
            visits = trial;
        }
    }
    visits
}

/// The first point once more behind all visits, unless they end there; whether it was put there.
pub(crate) fn put_return(visits: &mut Vec<Visit>) -> bool {
    match visits.as_slice() {
        [first, .., last] if first.index != last.index => {
            let index = first.index;
            visits.push(Visit { index, kind: StepKind::Return });
            true
        }
        _ => false,
    }
}

/// A jump behind all visits; one step less where they end at its start.
pub(crate) fn append(visits: &mut Vec<Visit>, from: usize, to: usize) {
    for index in [from, to] {
        if visits.last().is_none_or(|visit| visit.index != index) {
            visits.push(Visit { index, kind: StepKind::Repeat });
        }
    }
}

fn put(visits: &[Visit], at: usize, jump: RepeatedJump) -> Vec<Visit> {
    let mut longer = visits[..at].to_vec();
    if longer.last().is_none_or(|visit| visit.index != jump.from) {
        longer.push(Visit { index: jump.from, kind: StepKind::Repeat });
    }
    longer.push(Visit { index: jump.to, kind: StepKind::Repeat });
    longer.extend_from_slice(&visits[at..]);
    longer
}

/// Value of the points; the repeats themselves do not count, but for what is not allowed.
pub(crate) fn value<C: Chain>(chain: &C, visits: &[Visit], objective: Objective) -> f64 {
    let Some(first) = visits.first() else { return 0.0 };
    let (mut state, mut sum) = (chain.first(first.index), 0.0);
    let order: Vec<usize> = visits.iter().map(|visit| visit.index).collect();
    let back = way_back(chain, &order).filter(|(last, first)| last != first);
    let jumps = visits.windows(2).map(|pair| (pair[0].index, pair[1].index, pair[1].kind));
    for (from, to, kind) in jumps.chain(back.map(|(last, first)| (last, first, StepKind::Return))) {
        let (gradient_k, next) = chain.step(from, to, state);
        let value = objective.value(chain, from, to, gradient_k);
        let allowed = chain.admissible(from, to) && gradient_k.abs() <= chain.gradient_max_k();
        if kind.measures() || !allowed {
            sum += value;
        }
        state = next;
    }
    sum
}
