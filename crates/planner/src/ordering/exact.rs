//! The best order of few points, by branch and bound under thermal memory.

use crate::thermal_memory::chain::{Chain, way_back};
use crate::upper_bound::bound::Optimistic;

/// Outcome of a branch and bound.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Proof {
    /// The best order that was found; at least the given one.
    pub(crate) order: Vec<usize>,
    /// Whether no order is better by more than the tolerance.
    pub(crate) proven: bool,
}

/// Which figure is proven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Figure {
    Sum,
    Worst,
}

/// Improves `given` or proves that no order of its points beats it by more than `tolerance_ratio`, within `nodes` partial
/// orders.
pub(crate) fn branch_and_bound<C: Chain>(
    chain: &C,
    given: &[usize],
    optimistic: &Optimistic<'_>,
    figure: Figure,
    tolerance_ratio: f64,
    nodes: u64,
) -> Proof {
    let n = given.len();
    // The most that any jump to a point can give.
    let best_into: Vec<f64> = (0..n)
        .map(|j| (0..n).filter(|i| *i != j).map(|i| optimistic.weight_k(i, j)).fold(0.0, f64::max))
        .collect();
    let mut walk = Walk {
        chain,
        points: given,
        optimistic,
        best_into,
        figure,
        keep_ratio: 1.0 + tolerance_ratio,
        left: nodes,
        best: value_of(chain, given, figure),
        best_order: given.to_vec(),
        path: Vec::with_capacity(n),
        used: vec![false; n],
    };
    for (first, &point) in given.iter().enumerate() {
        let so_far = if figure == Figure::Sum { 0.0 } else { f64::INFINITY };
        walk.enter(first, chain.first(point), so_far);
    }
    Proof { proven: walk.left > 0, order: walk.best_order }
}

fn value_of<C: Chain>(chain: &C, order: &[usize], figure: Figure) -> f64 {
    let gradients = crate::thermal_memory::chain::gradients_k(chain, order);
    let barred = order.windows(2).any(|pair| !chain.admissible(pair[0], pair[1]))
        || way_back(chain, order).is_some_and(|(last, first)| !chain.admissible(last, first))
        || gradients.iter().any(|gradient_k| *gradient_k > chain.gradient_max_k());
    match figure {
        _ if barred => f64::NEG_INFINITY,
        Figure::Sum => gradients.iter().sum(),
        Figure::Worst => gradients.iter().copied().fold(f64::INFINITY, f64::min),
    }
}

struct Walk<'a, C: Chain> {
    chain: &'a C,
    points: &'a [usize],
    optimistic: &'a Optimistic<'a>,
    best_into: Vec<f64>,
    figure: Figure,
    keep_ratio: f64,
    left: u64,
    best: f64,
    best_order: Vec<usize>,
    path: Vec<usize>,
    used: Vec<bool>,
}

impl<C: Chain> Walk<'_, C> {
    fn enter(&mut self, place: usize, state: C::State, so_far: f64) {
        if self.left == 0 {
            return;
        }
        self.left -= 1;
        self.path.push(place);
        self.used[place] = true;
        if self.path.len() == self.points.len() {
            let order: Vec<usize> = self.path.iter().map(|place| self.points[*place]).collect();
            let whole = self.with_way_back(&order, state, so_far);
            if whole > self.best {
                self.best = whole;
                self.best_order = order;
            }
        } else if self.possible(place, so_far) > self.best * self.keep_ratio {
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
                let so_far = match self.figure {
                    Figure::Sum => so_far + gradient_k,
                    Figure::Worst => so_far.min(gradient_k),
                };
                self.enter(next, state, so_far);
            }
        }
        self.used[place] = false;
        self.path.pop();
    }

    /// The figure of a whole order, from that of its steps and what the last of them leaves.
    fn with_way_back(&self, order: &[usize], state: C::State, so_far: f64) -> f64 {
        let Some((last, first)) = way_back(self.chain, order) else { return so_far };
        let gradient_k = self.chain.step(last, first, state).0.abs();
        match self.figure {
            _ if gradient_k > self.chain.gradient_max_k() || !self.chain.admissible(last, first) => {
                f64::NEG_INFINITY
            }
            Figure::Sum => so_far + gradient_k,
            Figure::Worst => so_far.min(gradient_k),
        }
    }

    /// What this partial order can come to at most.
    fn possible(&self, last: usize, so_far: f64) -> f64 {
        let remaining = || (0..self.points.len()).filter(|place| !self.used[*place]);
        let into = |to: usize| {
            let inner = remaining().filter(|from| *from != to).map(|from| self.optimistic.weight_k(from, to));
            inner.fold(self.optimistic.weight_k(last, to), f64::max)
        };
        // The first point too has yet to be reached, where the order goes back to it.
        let first = self.path.first().copied().filter(|_| self.chain.returns());
        let reached = || remaining().chain(first);
        match self.figure {
            // The tighter of two bounds: how each point can be reached from the remaining points, or from any point.
            Figure::Sum => so_far + reached().map(|to| into(to).min(self.best_into[to])).sum::<f64>(),
            Figure::Worst => reached().map(into).fold(so_far, f64::min),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ordering::objective::Objective;
    use crate::ordering::search::{Effort, search};
    use proptest::prelude::*;

    /// Fixed weights: a machine without memory.
    struct Fixed {
        weights: Vec<f64>,
        n: usize,
        returns: bool,
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
        fn alike(&self, (): (), (): ()) -> bool {
            true
        }
        fn returns(&self) -> bool {
            self.returns
        }
    }

    fn best_of_all(chain: &Fixed, path: &mut Vec<usize>) -> f64 {
        if path.len() == chain.n {
            return crate::thermal_memory::chain::gradients_k(chain, path).iter().sum();
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
            let mut chain = Fixed { weights: weights[..n * n].to_vec(), n, returns: false };
            let best = best_of_all(&chain, &mut Vec::new());
            // So small that the search has no excuse.
            let given: Vec<usize> = (0..n).collect();
            let found = search(&chain, &given, Objective::Sum, Effort { moves: 20_000, starts: 2 }, 7).swap_remove(0);
            prop_assert!((Objective::Sum.figure(&chain, &found) - best).abs() < 1e-9);
            // The same with the way back to the first point.
            chain.returns = true;
            let best = best_of_all(&chain, &mut Vec::new());
            let found = search(&chain, &given, Objective::Sum, Effort { moves: 20_000, starts: 2 }, 7).swap_remove(0);
            prop_assert!((Objective::Sum.figure(&chain, &found) - best).abs() < 1e-9);
        }
    }
}
