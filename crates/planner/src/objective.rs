//! The objective of the search, and the promising successors of each point. Every objective is a sum over steps, so the effect of a change in the order follows from the few steps that change.

use crate::assignment::run_auction;
use crate::housing::{Chain, return_jump};
use mapper_numerics::statistics::nearest_rank;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// The figure to maximise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Objective {
    /// Sum of the gradients.
    Sum,
    /// Smallest gradient: minus the sum of squares of the shortfalls from a target, K^2; 0 if every gradient reaches the target.
    Minimum {
        /// Target, K.
        target_k: f64,
    },
}

/// Penalty of a forbidden step, K: no order can compensate for it.
pub(crate) const FORBIDDEN_PENALTY: f64 = 1e6;

impl Objective {
    /// Value of one step.
    #[inline]
    pub fn value<C: Chain>(self, chain: &C, from: usize, to: usize, gradient_k: f64) -> f64 {
        let size_k = gradient_k.abs();
        let value = match self {
            Objective::Sum => size_k,
            Objective::Minimum { target_k } => {
                let shortfall_k = (target_k - size_k).max(0.0);
                -shortfall_k * shortfall_k
            }
        };
        if size_k > chain.gradient_max_k() || !chain.admissible(from, to) {
            value - FORBIDDEN_PENALTY
        } else {
            value
        }
    }

    /// The figure of an order: sum or smallest gradient, minus the penalties of forbidden steps.
    pub fn figure<C: Chain>(self, chain: &C, order: &[usize]) -> f64 {
        let Some(&first) = order.first() else { return 0.0 };
        let mut state = chain.first(first);
        let (mut sum, mut smallest_k, mut penalty) = (0.0, f64::INFINITY, 0.0);
        let jumps = order.windows(2).map(|pair| (pair[0], pair[1])).chain(return_jump(chain, order));
        for (from, to) in jumps {
            let (gradient_k, next) = chain.step(from, to, state);
            let size_k = gradient_k.abs();
            smallest_k = smallest_k.min(size_k);
            sum += self.value(chain, from, to, gradient_k);
            if size_k > chain.gradient_max_k() || !chain.admissible(from, to) {
                penalty += FORBIDDEN_PENALTY;
            }
            state = next;
        }
        match self {
            Objective::Minimum { .. } => smallest_k.min(1e9) - penalty,
            Objective::Sum => sum,
        }
    }
}

const MAX_SUCCESSORS: usize = 10;
/// Maximum number of points with candidates: the table of weights grows with its square.
pub(crate) const MAX_POINTS: usize = 4000;
/// Lower limit of a weight: the assignment needs finite weights for forbidden jumps.
const MIN_VALUE: f64 = -1e9;

/// The best successors of each point of a chain.
pub(crate) struct Candidates {
    successors: Vec<Vec<usize>>,
}

impl Candidates {
    pub(crate) fn new<C: Chain>(chain: &C, given: &[usize], objective: Objective) -> Self {
        let n = given.len();
        let mut successors = vec![Vec::new(); chain.len()];
        if !(4..=MAX_POINTS).contains(&n) {
            return Candidates { successors };
        }
        let mut weight = Vec::with_capacity(n * n);
        for &from in given {
            let state = chain.settled(from);
            weight.extend(given.iter().map(|&to| {
                if from == to {
                    return MIN_VALUE;
                }
                objective.value(chain, from, to, chain.step(from, to, state).0).max(MIN_VALUE)
            }));
        }
        let finite: Vec<f64> = weight.iter().copied().filter(|weight| *weight > 0.5 * MIN_VALUE).collect();
        let quantile = |share| nearest_rank(&finite, share).unwrap_or(0.0);
        let spread = (quantile(0.98) - quantile(0.02)).max(1e-9);
        let prices = run_auction(n, &weight, (0.2 * spread, 2e-3 * spread));
        for (i, &from) in given.iter().enumerate() {
            let mut rated: Vec<(f64, usize)> = (0..n)
                .filter(|j| *j != i)
                .map(|j| (prices.profit[i] + prices.price[j] - weight[n * i + j], given[j]))
                .collect();
            if rated.len() > MAX_SUCCESSORS {
                rated.select_nth_unstable_by(MAX_SUCCESSORS, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                rated.truncate(MAX_SUCCESSORS);
            }
            rated.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            successors[from] = rated.into_iter().map(|(_, to)| to).collect();
        }
        Candidates { successors }
    }

    /// Draws a successor of `from`; `None` without candidates.
    pub(crate) fn draw(&self, from: usize, random: &mut Pcg64Mcg) -> Option<usize> {
        let successors = &self.successors[from];
        (!successors.is_empty()).then(|| successors[random.random_range(0..successors.len())])
    }
}
