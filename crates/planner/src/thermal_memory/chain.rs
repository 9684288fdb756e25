//! An order as a chain of steps, each judged by the state the one before has left.

/// A machine with memory, reduced to what ordering needs.
pub trait Chain {
    /// What a step leaves to the next.
    type State: Copy;

    /// Number of points.
    fn len(&self) -> usize;

    /// Whether it has no points.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// State after the first step, to which no jump leads.
    fn first(&self, to: usize) -> Self::State;

    /// The step `from` -> `to` from `state`: gradient of the housing within the window, K (signed), and the state after it.
    fn step(&self, from: usize, to: usize, state: Self::State) -> (f64, Self::State);

    /// State after a long stay at a point.
    fn settled(&self, at: usize) -> Self::State;

    /// Whether two states are so close that what follows no longer distinguishes them.
    fn alike(&self, a: Self::State, b: Self::State) -> bool;

    /// Whether the jump is allowed.
    fn admissible(&self, _from: usize, _to: usize) -> bool {
        true
    }

    /// Largest allowed gradient, K.
    fn gradient_max_k(&self) -> f64 {
        f64::INFINITY
    }

    /// Whether an order of two points and more ends with a jump back to its first point, which counts like the others.
    fn returns(&self) -> bool {
        false
    }
}

/// The jump back from the end of an order to its first point, where the chain makes one.
pub(crate) fn way_back<C: Chain>(chain: &C, order: &[usize]) -> Option<(usize, usize)> {
    match order {
        [first, .., last] if chain.returns() => Some((*last, *first)),
        _ => None,
    }
}

/// The gradients of an order, K (absolute values), one for each step that has a jump, the way back included.
pub fn gradients_k<C: Chain>(chain: &C, order: &[usize]) -> Vec<f64> {
    let mut gradients = Vec::with_capacity(order.len());
    let Some(&first) = order.first() else { return gradients };
    let mut state = chain.first(first);
    for pair in order.windows(2) {
        let (gradient_k, next) = chain.step(pair[0], pair[1], state);
        gradients.push(gradient_k.abs());
        state = next;
    }
    gradients.extend(way_back(chain, order).map(|(last, first)| chain.step(last, first, state).0.abs()));
    gradients
}
