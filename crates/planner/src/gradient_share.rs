//! Orders that keep a share of the largest gradients: among them the one that tells most.
//!
//! What steps are worth and the gradients that they have are two sums over the same steps. Made large together, with a weight
//! on the gradients, they give an order with more of the one and less of the other; the smallest weight is sought at which the
//! gradients are large enough (the weighting method of two objectives).

use crate::chain::{Chain, gradients_k};
use crate::housing::Housing;
use crate::objective::Objective;
use crate::search::{Effort, search};

/// Halvings of the logarithm of the weight.
const HALVINGS: usize = 6;
/// How far around the weight at which both ends are worth the same it is sought, ratio.
const AROUND_RATIO: f64 = 30.0;

/// An order, and the share of the largest sum of gradients that it keeps.
pub(crate) struct Kept {
    pub(crate) order: Vec<usize>,
    pub(crate) ratio: f64,
}

/// The order that is worth most among those that keep `share` (0 to 1) of the largest sum of gradients that is found. `worth` is
/// the same housing by what its steps are worth.
pub(crate) fn keeping(
    gradients: &Housing,
    worth: &Housing,
    given: &[usize],
    share: f64,
    effort: Effort,
    seed: u64,
) -> Kept {
    let total_k = |order: &[usize]| gradients_k(gradients, order).iter().sum::<f64>();
    let worth_of = |order: &[usize]| Objective::Sum.figure(worth, order);
    let steepest = search(gradients, given, Objective::Sum, effort, seed);
    let telling = search(worth, given, Objective::Sum, effort, seed);
    let most_k = total_k(&steepest).max(total_k(&telling));
    let kept = |order: Vec<usize>| {
        let ratio = if most_k > 0.0 { total_k(&order) / most_k } else { 1.0 };
        Kept { order, ratio }
    };
    let least_k = share * most_k;
    if total_k(&telling) >= least_k {
        return kept(telling);
    }
    let alike = (worth_of(&telling) - worth_of(&steepest)).max(1e-9)
        / (total_k(&steepest) - total_k(&telling)).max(1e-9);
    let (mut low, mut high) = ((alike / AROUND_RATIO).ln(), (alike * AROUND_RATIO).ln());
    let mut best = steepest;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let both = Both { gradients, worth, weight: middle.exp() };
        let found = search(&both, &best, Objective::Sum, effort, seed);
        if total_k(&found) < least_k {
            low = middle;
            continue;
        }
        high = middle;
        if worth_of(&found) > worth_of(&best) {
            best = found;
        }
    }
    kept(best)
}

/// What steps are worth, and so much of their gradients.
struct Both<'a> {
    gradients: &'a Housing,
    worth: &'a Housing,
    weight: f64,
}

impl Chain for Both<'_> {
    type State = [f64; 2];

    fn len(&self) -> usize {
        self.worth.len()
    }

    fn first(&self, to: usize) -> (Option<f64>, [f64; 2]) {
        let (gradient_k, _) = self.gradients.first(to);
        let (worth, state) = self.worth.first(to);
        (worth.zip(gradient_k).map(|(worth, k)| worth + self.weight * k.abs()), state)
    }

    #[inline]
    fn step(&self, from: usize, to: usize, state: [f64; 2]) -> (f64, [f64; 2]) {
        let (gradient_k, _) = self.gradients.step(from, to, state);
        let (worth, next) = self.worth.step(from, to, state);
        (worth + self.weight * gradient_k.abs(), next)
    }

    fn settled(&self, at: usize) -> [f64; 2] {
        self.worth.settled(at)
    }

    #[inline]
    fn alike(&self, a: [f64; 2], b: [f64; 2]) -> bool {
        self.worth.alike(a, b)
    }

    #[inline]
    fn admissible(&self, from: usize, to: usize) -> bool {
        self.worth.admissible(from, to)
    }

    fn returns(&self) -> bool {
        self.worth.returns()
    }
}
