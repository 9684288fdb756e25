//! The objective of the search. Every objective is a sum over steps, so the effect of a change in the order follows from the few steps
//! that change.

use crate::thermal_memory::chain::{Chain, return_jump};

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
