//! What an order is judged by. Every objective is a sum over steps, so that a change of the order is judged by the few
//! steps it touches.

use crate::thermal_memory::chain::{Chain, way_back};

/// What is made large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Objective {
    /// Sum of the gradients.
    Sum,
    /// Smallest gradient: minus the sum of the squares by which gradients fall short of a target, K^2. It is 0 where no
    /// gradient is smaller than the target.
    Worst {
        /// Target, K.
        target_k: f64,
    },
}

/// A step that is not allowed costs this much: more than any order can make up for.
pub(crate) const NOT_ALLOWED: f64 = 1e6;

impl Objective {
    /// Value of one step.
    #[inline]
    pub fn value<C: Chain>(self, chain: &C, from: usize, to: usize, gradient_k: f64) -> f64 {
        let size_k = gradient_k.abs();
        let value = match self {
            Objective::Sum => size_k,
            Objective::Worst { target_k } => {
                let missing_k = (target_k - size_k).max(0.0);
                -missing_k * missing_k
            }
        };
        if size_k > chain.gradient_max_k() || !chain.admissible(from, to) {
            value - NOT_ALLOWED
        } else {
            value
        }
    }

    /// The figure itself of an order: sum or smallest gradient; what is not allowed counts as in the search.
    pub fn figure<C: Chain>(self, chain: &C, order: &[usize]) -> f64 {
        let Some(&first) = order.first() else { return 0.0 };
        let mut state = chain.first(first);
        let (mut sum, mut smallest_k, mut barred) = (0.0, f64::INFINITY, 0.0);
        let jumps = order.windows(2).map(|pair| (pair[0], pair[1])).chain(way_back(chain, order));
        for (from, to) in jumps {
            let (gradient_k, next) = chain.step(from, to, state);
            let size_k = gradient_k.abs();
            smallest_k = smallest_k.min(size_k);
            sum += self.value(chain, from, to, gradient_k);
            if size_k > chain.gradient_max_k() || !chain.admissible(from, to) {
                barred += NOT_ALLOWED;
            }
            state = next;
        }
        match self {
            Objective::Worst { .. } => smallest_k.min(1e9) - barred,
            Objective::Sum => sum,
        }
    }
}
