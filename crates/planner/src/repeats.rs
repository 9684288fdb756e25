//! Repeats for drift: one jump, made again at a spacing, where it costs least.

use crate::chain::Chain;
use crate::objective::Objective;
use mapper_core::StepKind;

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
    pub(crate) every_steps: usize,
    pub(crate) at_least: usize,
}

impl RepeatedJump {
    /// How often it is made among `points` points: at both ends, and in between at the spacing or closer.
    pub(crate) fn count(&self, points: usize) -> usize {
        (points.div_ceil(self.every_steps.max(1)) + 1).max(self.at_least).min(points.max(1))
    }
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
    let (points, count) = (order.len(), jump.count(order.len()));
    let spacing = points as f64 / (count.max(2) - 1) as f64;
    let slack = (spacing / 4.0).floor() as usize;
    let mut inserted = 0;
    for repeat in 0..count {
        // Counted in points of the order; at least one step comes before.
        let ideal = ((repeat as f64 * spacing).round() as usize).clamp(1, points);
        let candidates = ideal.saturating_sub(slack).max(1)..=(ideal + slack).min(points);
        let best = candidates
            .map(|place| {
                let at = place + inserted;
                let trial = put(&visits, at, jump);
                // Fewer steps first.
                let steps = trial.len() as f64;
                (steps, -value(chain, &trial, objective), place.abs_diff(ideal), trial)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        if let Some((.., trial)) = best {
            inserted += trial.len() - visits.len();
            visits = trial;
        }
    }
    visits
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

/// What the points are worth; the repeats themselves do not count, but for what is not allowed.
fn value<C: Chain>(chain: &C, visits: &[Visit], objective: Objective) -> f64 {
    let Some(first) = visits.first() else { return 0.0 };
    let (gradient_k, mut state) = chain.first(first.index);
    let mut sum = objective.first_value(chain, first.index, gradient_k);
    for pair in visits.windows(2) {
        let (gradient_k, next) = chain.step(pair[0].index, pair[1].index, state);
        let value = objective.value(chain, pair[0].index, pair[1].index, gradient_k);
        if pair[1].kind == StepKind::Point || !chain.admissible(pair[0].index, pair[1].index) {
            sum += value;
        }
        state = next;
    }
    sum
}
