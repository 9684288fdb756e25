//! An order as a chain of steps, each of which starts from the final state of the previous one.

/// A machine with memory, reduced to the functions that the search needs.
pub trait Chain {
    /// State that one step passes to the next.
    type State: Copy;

    /// Number of points.
    fn len(&self) -> usize;

    /// Whether the chain has no points.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// State after the first step of an order, which has no jump.
    fn first(&self, to: usize) -> Self::State;

    /// Makes the step `from` -> `to` from `state`: change of the housing temperature in the window, K (signed), and the final state.
    fn step(&self, from: usize, to: usize, state: Self::State) -> (f64, Self::State);

    /// Steady state of a point.
    fn settled(&self, at: usize) -> Self::State;

    /// Whether the difference of two states is negligible for all later steps.
    fn is_indistinguishable(&self, a: Self::State, b: Self::State) -> bool;

    /// Whether the jump is allowed.
    fn admissible(&self, _from: usize, _to: usize) -> bool {
        true
    }

    /// Largest allowed gradient, K.
    fn gradient_max_k(&self) -> f64 {
        f64::INFINITY
    }

    /// Whether an order of two or more points ends with a jump back to its first point, which counts like the others.
    fn has_return(&self) -> bool {
        false
    }
}

/// The repeated jump between two points of a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RepeatedJump {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) count: usize,
}

/// The jump from the last point of an order back to its first, if the chain has one.
pub(crate) fn return_jump<C: Chain>(chain: &C, order: &[usize]) -> Option<(usize, usize)> {
    match order {
        [first, .., last] if chain.has_return() => Some((*last, *first)),
        _ => None,
    }
}

/// The absolute gradients of an order, K: one for each step with a jump, the return included.
pub fn gradients_k<C: Chain>(chain: &C, order: &[usize]) -> Vec<f64> {
    let mut gradients = Vec::with_capacity(order.len());
    let Some(&first) = order.first() else { return gradients };
    let mut state = chain.first(first);
    for pair in order.windows(2) {
        let (gradient_k, next) = chain.step(pair[0], pair[1], state);
        gradients.push(gradient_k.abs());
        state = next;
    }
    gradients.extend(return_jump(chain, order).map(|(last, first)| chain.step(last, first, state).0.abs()));
    gradients
}
