//! Orders a set of points by the criterion of the request: by rule, by search, and for few points by a branch and bound that proves the best order.

use crate::bound::GradientBounds;
use crate::housing::{Chain, Housing, return_jump};
use crate::objective::Objective;
use crate::request::PlanRequest;
use crate::search::{Effort, search, search_min_gradient};
use mapper_core::{OperatingPoint, VisitOrder};

/// Outcome of a branch and bound.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Proof {
    /// The best order found; never worse than the given one.
    pub(crate) order: Vec<usize>,
    /// Whether no order is better by more than the tolerance.
    pub(crate) proven: bool,
}

/// The figure to maximise: the sum of the gradients, or the smallest gradient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Figure {
    Sum,
    Minimum,
}

/// Improves `given`, or proves that no order of its points is better by more than `tolerance_ratio`. Visits at most `nodes` partial
/// orders.
pub(crate) fn branch_and_bound<C: Chain>(
    chain: &C,
    given: &[usize],
    gradient_bounds: &GradientBounds<'_>,
    figure: Figure,
    tolerance_ratio: f64,
    nodes: u64,
) -> Proof {
    let n = given.len();
    // Largest gradient of any jump to each point.
    let max_gradient_into_k: Vec<f64> = (0..n)
        .map(|j| (0..n).filter(|i| *i != j).map(|i| gradient_bounds.weight_k(i, j)).fold(0.0, f64::max))
        .collect();
    let mut search = BranchAndBound {
        chain,
        points: given,
        gradient_bounds,
        max_gradient_into_k,
        figure,
        keep_ratio: 1.0 + tolerance_ratio,
        nodes_left: nodes,
        best: figure_of(chain, given, figure),
        best_order: given.to_vec(),
        path: Vec::with_capacity(n),
        used: vec![false; n],
    };
    for (first, &point) in given.iter().enumerate() {
        let partial_k = if figure == Figure::Sum { 0.0 } else { f64::INFINITY };
        search.extend(first, chain.first(point), partial_k);
    }
    Proof { proven: search.nodes_left > 0, order: search.best_order }
}

fn figure_of<C: Chain>(chain: &C, order: &[usize], figure: Figure) -> f64 {
    let gradients = crate::housing::gradients_k(chain, order);
    let is_forbidden = order.windows(2).any(|pair| !chain.admissible(pair[0], pair[1]))
        || return_jump(chain, order).is_some_and(|(last, first)| !chain.admissible(last, first))
        || gradients.iter().any(|gradient_k| *gradient_k > chain.gradient_max_k());
    match figure {
        _ if is_forbidden => f64::NEG_INFINITY,
        Figure::Sum => gradients.iter().sum(),
        Figure::Minimum => gradients.iter().copied().fold(f64::INFINITY, f64::min),
    }
}

struct BranchAndBound<'a, C: Chain> {
    chain: &'a C,
    points: &'a [usize],
    gradient_bounds: &'a GradientBounds<'a>,
    max_gradient_into_k: Vec<f64>,
    figure: Figure,
    keep_ratio: f64,
    nodes_left: u64,
    best: f64,
    best_order: Vec<usize>,
    path: Vec<usize>,
    used: Vec<bool>,
}

impl<C: Chain> BranchAndBound<'_, C> {
    fn extend(&mut self, place: usize, state: C::State, partial_k: f64) {
        if self.nodes_left == 0 {
            return;
        }
        self.nodes_left -= 1;
        self.path.push(place);
        self.used[place] = true;
        if self.path.len() == self.points.len() {
            let order: Vec<usize> = self.path.iter().map(|place| self.points[*place]).collect();
            let complete_k = self.add_return_jump(&order, state, partial_k);
            if complete_k > self.best {
                self.best = complete_k;
                self.best_order = order;
            }
        } else if self.bound_remaining(place, partial_k) > self.best * self.keep_ratio {
            let from = self.points[place];
            let mut next: Vec<(f64, usize, C::State)> = (0..self.points.len())
                .filter(|next| !self.used[*next] && self.chain.admissible(from, self.points[*next]))
                .map(|next| {
                    let (gradient_k, state) = self.chain.step(from, self.points[next], state);
                    (gradient_k.abs(), next, state)
                })
                .filter(|(gradient_k, ..)| *gradient_k <= self.chain.gradient_max_k())
                .collect();
            next.sort_by(|a, b| b.0.total_cmp(&a.0));
            for (gradient_k, next, state) in next {
                let partial_k = match self.figure {
                    Figure::Sum => partial_k + gradient_k,
                    Figure::Minimum => partial_k.min(gradient_k),
                };
                self.extend(next, state, partial_k);
            }
        }
        self.used[place] = false;
        self.path.pop();
    }

    /// Adds the return jump to the figure of a complete order; `state` is the state after its last step.
    fn add_return_jump(&self, order: &[usize], state: C::State, partial_k: f64) -> f64 {
        let Some((last, first)) = return_jump(self.chain, order) else { return partial_k };
        let gradient_k = self.chain.step(last, first, state).0.abs();
        match self.figure {
            _ if gradient_k > self.chain.gradient_max_k() || !self.chain.admissible(last, first) => {
                f64::NEG_INFINITY
            }
            Figure::Sum => partial_k + gradient_k,
            Figure::Minimum => partial_k.min(gradient_k),
        }
    }

    /// Upper bound on the figure of any completion of this partial order.
    fn bound_remaining(&self, last: usize, partial_k: f64) -> f64 {
        let remaining = || (0..self.points.len()).filter(|place| !self.used[*place]);
        let bound_into = |to: usize| {
            let inner =
                remaining().filter(|from| *from != to).map(|from| self.gradient_bounds.weight_k(from, to));
            inner.fold(self.gradient_bounds.weight_k(last, to), f64::max)
        };
        // If the order returns to its first point, that point has yet to be reached too.
        let first = self.path.first().copied().filter(|_| self.chain.has_return());
        let reached = || remaining().chain(first);
        match self.figure {
            // The smaller of two bounds for each point: reached from the remaining points, or from any point.
            Figure::Sum => {
                partial_k + reached().map(|to| bound_into(to).min(self.max_gradient_into_k[to])).sum::<f64>()
            }
            Figure::Minimum => reached().map(bound_into).fold(partial_k, f64::min),
        }
    }
}

/// Repeats are inserted so that gradients stay above this, K, if possible.
const REPEATS_KEEP_K: f64 = 30.0;
/// An order is proven to be the best if no other order is better by more than this.
pub(crate) const PROOF_TOLERANCE_RATIO: f64 = 1e-3;
/// Maximum number of points for a proof: with more points it rarely ends within [`PROOF_NODES`].
const MAX_PROVEN_POINTS: usize = 14;
/// Maximum number of partial orders of a proof: a fraction of a second.
const PROOF_NODES: u64 = 300_000;

#[derive(Debug, Clone)]
pub(crate) struct PointOrder {
    pub(crate) order: Vec<usize>,
    /// Whether the order is proven to be the best within [`PROOF_TOLERANCE_RATIO`] on the reduced housing.
    pub(crate) proven: bool,
}

impl PointOrder {
    fn unproven(order: Vec<usize>) -> Self {
        PointOrder { order, proven: false }
    }
}

/// Order along speed lines: by speed, and on each line from the widest opening to the narrowest.
pub(crate) fn compare_along_speed_lines(a: &OperatingPoint, b: &OperatingPoint) -> std::cmp::Ordering {
    let by_opening = b.valve_opening_ratio.total_cmp(&a.valve_opening_ratio);
    a.speed_rpm.total_cmp(&b.speed_rpm).then(by_opening)
}

/// The objective of the search for this kind of order.
pub(crate) fn objective(order: VisitOrder) -> Objective {
    match order {
        VisitOrder::MinGradient => Objective::Minimum { target_k: REPEATS_KEEP_K },
        _ => Objective::Sum,
    }
}

/// Searches orders of the `given` points, the best first. Several are returned because repeats may change their ranking.
pub(crate) fn search_orders(
    housing: &Housing,
    points: &[OperatingPoint],
    given: &[usize],
    request: &PlanRequest<'_>,
) -> Vec<PointOrder> {
    let effort = Effort::usual(given.len(), request.effort);
    let (orders, figure) = match request.order {
        VisitOrder::Listed => return vec![PointOrder::unproven(given.to_vec())],
        VisitOrder::SpeedLines | VisitOrder::Conventional => {
            let mut order = given.to_vec();
            order.sort_by(|a, b| compare_along_speed_lines(&points[*a], &points[*b]));
            return vec![PointOrder::unproven(order)];
        }
        VisitOrder::ThermalGradient => {
            (search(housing, given, Objective::Sum, effort, request.seed), Figure::Sum)
        }
        VisitOrder::MinGradient => {
            (vec![search_min_gradient(housing, given, effort, request.seed)], Figure::Minimum)
        }
    };
    let best = orders.first().filter(|order| request.bound && order.len() <= MAX_PROVEN_POINTS);
    let gradient_bounds = best.and_then(|order| Some((order, GradientBounds::new(housing, order)?)));
    if let Some((order, gradient_bounds)) = gradient_bounds {
        let proof =
            branch_and_bound(housing, order, &gradient_bounds, figure, PROOF_TOLERANCE_RATIO, PROOF_NODES);
        if proof.proven {
            return vec![PointOrder { order: proof.order, proven: true }];
        }
    }
    orders.into_iter().map(PointOrder::unproven).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::Objective;
    use crate::search::{Effort, search};
    use proptest::prelude::*;

    /// Fixed weights: a machine without memory.
    struct Fixed {
        weights: Vec<f64>,
        n: usize,
        has_return: bool,
    }

    impl Chain for Fixed {
        type State = ();
        fn len(&self) -> usize {
            self.n
        }
        fn first(&self, _: usize) {}
        fn step(&self, from: usize, to: usize, (): ()) -> (f64, ()) {
            (self.weights[from * self.n + to], ())
        }
        fn settled(&self, _: usize) {}
        fn is_indistinguishable(&self, (): (), (): ()) -> bool {
            true
        }
        fn has_return(&self) -> bool {
            self.has_return
        }
    }

    fn best_of_all(chain: &Fixed, path: &mut Vec<usize>) -> f64 {
        if path.len() == chain.n {
            return crate::housing::gradients_k(chain, path).iter().sum();
        }
        let mut best = f64::NEG_INFINITY;
        for next in 0..chain.n {
            if !path.contains(&next) {
                path.push(next);
                best = best.max(best_of_all(chain, path));
                path.pop();
            }
        }
        best
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn brute_force_agrees(weights in prop::collection::vec(0.0..30.0f64, 49), n in 2usize..=7) {
            let mut chain = Fixed { weights: weights[..n * n].to_vec(), n, has_return: false };
            let best = best_of_all(&chain, &mut Vec::new());
            // The problem is so small that the search must find the optimum.
            let given: Vec<usize> = (0..n).collect();
            let found = search(&chain, &given, Objective::Sum, Effort { moves: 20_000, starts: 2 }, 7).swap_remove(0);
            prop_assert!((Objective::Sum.figure(&chain, &found) - best).abs() < 1e-9);
            // Include the return to the first point.
            chain.has_return = true;
            let best = best_of_all(&chain, &mut Vec::new());
            let found = search(&chain, &given, Objective::Sum, Effort { moves: 20_000, starts: 2 }, 7).swap_remove(0);
            prop_assert!((Objective::Sum.figure(&chain, &found) - best).abs() < 1e-9);
        }
    }
}
