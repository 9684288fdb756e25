//! The visits of a plan: its points in order, repeats of one jump to detect drift, the return to the first point, and an appended jump.

use crate::housing::{Chain, FORBIDDEN_PENALTY_K, RepeatedJump, return_jump, value_k};
use crate::jump_forecast::forecast_jump;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{Jump, OperatingPoint, Repeats, StepKind};
use mapper_physics::simulation::steady::SteadyState;

/// Maximum number of simulated jumps in the search for a jump to repeat.
const MAX_SIMULATED_JUMPS: usize = 24;

/// In plans of at most this many points, a repeat may move anywhere if no position near its own is allowed.
const MAX_POINTS_FREE_REPEATS: usize = 200;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Visit {
    pub(crate) index: usize,
    pub(crate) kind: StepKind,
}

/// Number of repeats in a plan of `points` points: one at each end, and others in between, at most the requested spacing apart.
pub(crate) fn repeat_count(repeats: Repeats, points: usize) -> usize {
    (points.div_ceil(repeats.every_steps.max(1)) + 1).max(repeats.at_least).min(points.max(1))
}

/// Lists allowed jumps for repeats, best first: a large rise in speed at a middle opening changes the housing temperature most, and ends
/// at high speed, where the efficiency has the smallest error.
pub(crate) fn propose_repeated_jumps(
    request: &PlanRequest<'_>,
    targets: &[SteadyState],
) -> Result<Vec<Jump>, PlanError> {
    let points = request.points;
    let mut openings: Vec<f64> = points.iter().map(|point| point.valve_opening_ratio).collect();
    openings.sort_by(f64::total_cmp);
    let Some(&middle) = openings.get(openings.len() / 2) else { return Ok(Vec::new()) };
    // Jumps at one opening, from the slowest point. If no opening has two speeds, jumps between openings.
    let mut jumps: Vec<(usize, usize)> = Vec::new();
    openings.dedup();
    for opening in &openings {
        let has_opening = |i: &usize| points[*i].valve_opening_ratio == *opening;
        jumps.extend(jumps_from_slowest(points, (0..points.len()).filter(has_opening).collect()));
    }
    if jumps.is_empty() {
        jumps = jumps_from_slowest(points, (0..points.len()).collect());
    }
    let off_middle = |i: usize| (points[i].valve_opening_ratio - middle).abs();
    jumps.sort_by(|a, b| {
        let by_opening = off_middle(a.1).total_cmp(&off_middle(b.1));
        by_opening.then(points[b.1].speed_rpm.total_cmp(&points[a.1].speed_rpm)).then(a.cmp(b))
    });
    let mut allowed = Vec::new();
    for (from, to) in jumps.into_iter().take(MAX_SIMULATED_JUMPS) {
        let dwell_s = request.timing.dwell.fixed_or_usual_s();
        let jump =
            forecast_jump(request, (points[from], &targets[from]), (points[to], &targets[to]), dwell_s)?;
        if jump.rejections.is_empty() {
            allowed.push(Jump { from: jump.from, to: jump.to });
        }
    }
    Ok(allowed)
}

/// Lists the jumps from the slowest of some points to each faster one.
fn jumps_from_slowest(points: &[OperatingPoint], selected: Vec<usize>) -> Vec<(usize, usize)> {
    let by_speed = |a: &usize, b: &usize| points[*a].speed_rpm.total_cmp(&points[*b].speed_rpm);
    let Some(slowest) = selected.iter().copied().min_by(by_speed) else { return Vec::new() };
    let faster = |to: &usize| points[*to].speed_rpm > points[slowest].speed_rpm;
    selected.into_iter().filter(faster).map(|to| (slowest, to)).collect()
}

pub(crate) fn visits_of_points(order: &[usize]) -> Vec<Visit> {
    order.iter().map(|&index| Visit { index, kind: StepKind::Point }).collect()
}

/// Inserts the repeats of a jump into an order.
///
/// Each repeat may move by a quarter of the spacing to a position where the order visits the start of the jump anyway, so that the repeat
/// adds one step instead of two. Among equal positions, the one with the smallest loss of gradient at the points wins.
pub(crate) fn insert_repeats<C: Chain>(chain: &C, order: &[usize], jump: RepeatedJump) -> Vec<Visit> {
    let mut visits = visits_of_points(order);
    let (points, count) = (order.len(), jump.count);
    let spacing = points as f64 / (count.max(2) - 1) as f64;
    let slack = (spacing / 4.0).floor() as usize;
    let mut inserted = 0;
    for repeat in 0..count {
        // Position as a number of points, at least one.
        let ideal = ((repeat as f64 * spacing).round() as usize).clamp(1, points);
        let before = value(chain, &visits);
        let best_of = |places: std::ops::RangeInclusive<usize>| {
            // Exclude positions between the two steps of another repeat.
            let free =
                |place: &usize| visits.get(place + inserted).is_none_or(|next| next.kind == StepKind::Point);
            places
                .filter(free)
                .map(|place| {
                    let at = place + inserted;
                    let trial = insert_repeat(&visits, at, jump);
                    let value = value(chain, &trial);
                    // Prefer allowed positions, then fewer steps.
                    let is_forbidden = value < before - 0.5 * FORBIDDEN_PENALTY_K;
                    ((is_forbidden, trial.len()), -value, place.abs_diff(ideal), trial)
                })
                .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)))
        };
        let nearby = best_of(ideal.saturating_sub(slack).max(1)..=(ideal + slack).min(points));
        let best = match nearby {
            // A distant position is better than a forbidden one.
            Some(((true, _), ..)) if points <= MAX_POINTS_FREE_REPEATS => best_of(1..=points),
            nearby => nearby,
        };
        if let Some((.., trial)) = best {
            inserted += trial.len() - visits.len();
            visits = trial;
        }
    }
    visits
}

/// Appends a visit of the first point, unless the visits already end there.
pub(crate) fn append_return(visits: &mut Vec<Visit>) {
    if let [first, .., last] = visits.as_slice()
        && first.index != last.index
    {
        visits.push(Visit { index: first.index, kind: StepKind::Return });
    }
}

/// Appends a jump: its two steps, or one if the visits end at its start.
pub(crate) fn append_jump(visits: &mut Vec<Visit>, from: usize, to: usize) {
    for index in [from, to] {
        if visits.last().is_none_or(|visit| visit.index != index) {
            visits.push(Visit { index, kind: StepKind::Repeat });
        }
    }
}

fn insert_repeat(visits: &[Visit], at: usize, jump: RepeatedJump) -> Vec<Visit> {
    let mut longer = visits[..at].to_vec();
    if longer.last().is_none_or(|visit| visit.index != jump.from) {
        longer.push(Visit { index: jump.from, kind: StepKind::Repeat });
    }
    longer.push(Visit { index: jump.to, kind: StepKind::Repeat });
    longer.extend_from_slice(&visits[at..]);
    longer
}

/// Value of the visits that measure points. Repeats count only if they are forbidden.
pub(crate) fn value<C: Chain>(chain: &C, visits: &[Visit]) -> f64 {
    let Some(first) = visits.first() else { return 0.0 };
    let (mut state, mut sum) = (chain.first(first.index), 0.0);
    let order: Vec<usize> = visits.iter().map(|visit| visit.index).collect();
    let back = return_jump(chain, &order).filter(|(last, first)| last != first);
    let jumps = visits.windows(2).map(|pair| (pair[0].index, pair[1].index, pair[1].kind));
    for (from, to, kind) in jumps.chain(back.map(|(last, first)| (last, first, StepKind::Return))) {
        let (gradient_k, next) = chain.step(from, to, state);
        let value = value_k(chain, from, to, gradient_k);
        let allowed = chain.admissible(from, to) && gradient_k.abs() <= chain.gradient_max_k();
        if kind.measures() || !allowed {
            sum += value;
        }
        state = next;
    }
    sum
}
