//! Upper bound on the sum of gradients of any order, by Lagrangian relaxation.
//!
//! The best assignment of successors bounds the sum if each jump may start from its most favourable state. That bound is loose when the
//! housing has a long memory, because a visit may end in one state and the next jump start from another. Here the state of each visit
//! has a price, which a jump receives at its end and pays at its start. The prices cancel along an order, so the bound is valid for any
//! prices; the subgradient method finds prices that make it small (Fisher, Management Science 27:1, 1981).
//!
//! A price is piecewise linear in Tc and linear in Tt. Gradients and states are convex or affine on each piece, except for a small
//! quadratic part that is bounded separately. The largest weight of a jump is therefore at a corner of the pieces.

use crate::assignment::solve_assignment;
use crate::housing::{Chain, Housing, RepeatedJump, StateBox, Surface};
use mapper_numerics::parallel;

/// Knots of a price over the Tc range of a visit: more of them lower the bound of turbo_a by less than 0.2 %.
const KNOTS: usize = 7;
/// Maximum number of iterations, and of pairs of visits in all of them: some tenths of a second. A hundred more iterations lower the
/// bound of turbo_a by 0.2 %.
const MAX_ITERATIONS: usize = 100;
const MAX_PAIRS: usize = 1_000_000;
/// Step control of the subgradient method: first step relative to Polyak's, its reduction after `PATIENCE` iterations without a
/// smaller bound, and the share of the previous direction in the next one (Camerini, Fratta and Maffioli, Mathematical Programming Study
/// 3:26, 1975). Any values give a valid bound; these gave the smallest for turbo_a after 100 iterations.
const FIRST_STEP: f64 = 0.7;
const STEP_REDUCTION: f64 = 0.7;
const PATIENCE: usize = 4;
const MEMORY: f64 = 0.5;
/// Number of first points whose assignment is solved exactly, those with the largest bounds. The bound of the next one covers all others.
const MAX_EXACT_FIRST_POINTS: usize = 32;
/// Weight of an impossible jump, K: no sum of gradients can compensate for it.
const IMPOSSIBLE_K: f64 = -1e9;

/// The visits whose order is bounded.
pub(crate) struct RelaxationProblem<'a> {
    pub(crate) housing: &'a Housing,
    /// Points of the housing; only repeats visit those from `counted` on.
    pub(crate) points: &'a [usize],
    pub(crate) counted: usize,
    /// Range of the states at the end of a dwell at each point.
    pub(crate) boxes: &'a [StateBox],
    pub(crate) repeated: Option<RepeatedJump>,
    /// Whether the order ends with a jump back to its first point.
    pub(crate) has_return: bool,
}

/// A node of the relaxation.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Node {
    /// The visit of a point, by its place.
    Point(usize),
    /// An extra visit of the start of the repeated jump; optional.
    RepeatFrom(usize),
    /// The end of a repeated jump.
    RepeatTo(usize),
    /// Predecessor of the first visit and successor of the last.
    Outside,
}

impl Node {
    fn place(self) -> Option<usize> {
        match self {
            Node::Point(place) | Node::RepeatFrom(place) | Node::RepeatTo(place) => Some(place),
            Node::Outside => None,
        }
    }
}

/// Price of the final state of a visit, K.
#[derive(Debug, Clone, Copy)]
struct Price {
    low: f64,
    spacing: f64,
    /// Values at knots that are evenly spaced over the range of scaled Tc.
    knots_k: [f64; KNOTS],
    /// Slope over scaled Tt.
    slope_k: f64,
}

impl Price {
    fn zero(range: (f64, f64)) -> Self {
        let spacing = ((range.1 - range.0) / (KNOTS - 1) as f64).max(1e-9);
        Price { low: range.0, spacing, knots_k: [0.0; KNOTS], slope_k: 0.0 }
    }

    /// The knot below a state, and the state's distance from it in spacings.
    #[inline]
    fn piece(&self, c: f64) -> (usize, f64) {
        let x = (c - self.low) / self.spacing;
        let below = (x.max(0.0) as usize).min(KNOTS - 2);
        (below, x - below as f64)
    }

    #[inline]
    fn at(&self, c: f64, t: f64) -> f64 {
        let (below, x) = self.piece(c);
        let [a, b] = [self.knots_k[below], self.knots_k[below + 1]];
        a + (b - a) * x + self.slope_k * t
    }

    fn knot(&self, index: usize) -> f64 {
        self.low + self.spacing * index as f64
    }

    /// Largest slope over scaled Tc, K.
    fn steepest_k(&self) -> f64 {
        let slopes = self.knots_k.windows(2).map(|pair| (pair[1] - pair[0]).abs() / self.spacing);
        slopes.fold(0.0, f64::max)
    }

    /// Changes the price of a state.
    fn add(&mut self, (c, t): (f64, f64), by_k: f64) {
        let (below, x) = self.piece(c);
        self.knots_k[below] += by_k * (1.0 - x);
        self.knots_k[below + 1] += by_k * x;
        self.slope_k += by_k * t;
    }
}

/// The largest weight of a jump, and the initial state at which it occurs.
#[derive(Debug, Clone, Copy)]
struct JumpWeight {
    weight_k: f64,
    state: (f64, f64),
}

/// Bounds the sum of gradients of any order from above. `found_k`: the sum of a known order.
pub(crate) fn bound_sum_k(problem: &RelaxationProblem<'_>, found_k: f64) -> f64 {
    let nodes = build_nodes(problem);
    let relaxation = Relaxation { problem, nodes: &nodes };
    let mut prices: Vec<Price> = nodes
        .iter()
        .map(|node| Price::zero(node.place().map_or((0.0, 1.0), |place| problem.boxes[place].0)))
        .collect();
    let pairs = nodes.len() * nodes.len();
    let iterations = (MAX_PAIRS / pairs.max(1)).min(MAX_ITERATIONS);
    let (mut bound_k, mut best_prices) = (f64::INFINITY, prices.clone());
    let (mut step, mut stalled) = (FIRST_STEP, 0);
    let mut direction: Vec<Price> = prices.clone();
    for _ in 0..=iterations {
        let table = relaxation.table(&prices);
        let weight = |from: usize, to: usize| table[from * nodes.len() + to].weight_k;
        let (sum_k, successor) = solve_assignment(nodes.len(), weight);
        if sum_k < bound_k - 1e-6 * sum_k.abs() {
            (bound_k, stalled) = (sum_k, 0);
            best_prices.clone_from(&prices);
        } else {
            stalled += 1;
            if stalled == PATIENCE {
                (step, stalled) = (step * STEP_REDUCTION, 0);
                prices.clone_from(&best_prices);
                continue;
            }
        }
        if sum_k - found_k <= 1e-3 * found_k.abs() {
            break;
        }
        relaxation.descend(&mut prices, &mut direction, &table, &successor, step * (sum_k - found_k));
    }
    if problem.has_return { relaxation.bound_with_return_k(&best_prices, bound_k) } else { bound_k }
}

fn build_nodes(problem: &RelaxationProblem<'_>) -> Vec<Node> {
    let mut nodes: Vec<Node> = (0..problem.counted).map(Node::Point).collect();
    if let Some(RepeatedJump { from, to, count }) = problem.repeated {
        nodes.extend((0..count).flat_map(|_| [Node::RepeatFrom(from), Node::RepeatTo(to)]));
    }
    if !problem.has_return {
        nodes.push(Node::Outside);
    }
    nodes
}

struct Relaxation<'a> {
    problem: &'a RelaxationProblem<'a>,
    nodes: &'a [Node],
}

impl Relaxation<'_> {
    /// The weight of each jump, row after row.
    fn table(&self, prices: &[Price]) -> Vec<JumpWeight> {
        let rows: Vec<usize> = (0..self.nodes.len()).collect();
        let row = |from: &usize| -> Vec<JumpWeight> {
            (0..self.nodes.len()).map(|to| self.weight(*from, to, prices, EndPricing::Priced)).collect()
        };
        parallel::map(&rows, row).into_iter().flatten().collect()
    }

    fn weight(&self, from: usize, to: usize, prices: &[Price], ends: EndPricing) -> JumpWeight {
        let impossible = JumpWeight { weight_k: IMPOSSIBLE_K, state: (0.0, 0.0) };
        let problem = self.problem;
        let first = |place: usize| {
            let [c, t] = problem.housing.first(problem.points[place]);
            (c, t)
        };
        let start = self.nodes[from].place().filter(|_| ends == EndPricing::First).map(first);
        match (self.nodes[from], self.nodes[to]) {
            // The extra visit is omitted.
            (Node::RepeatFrom(_), Node::RepeatFrom(_)) if from == to => {
                JumpWeight { weight_k: 0.0, ..impossible }
            }
            (Node::Outside, Node::Point(place)) => {
                let state = first(place);
                JumpWeight { weight_k: prices[to].at(state.0, state.1), state }
            }
            (Node::Outside, _) => impossible,
            (node, Node::Outside) => match node.place() {
                Some(place) if !matches!(node, Node::RepeatFrom(_)) => {
                    find_lowest_price(&prices[from], problem.boxes[place])
                }
                _ => impossible,
            },
            (Node::RepeatFrom(_), Node::Point(_) | Node::RepeatFrom(_)) => impossible,
            (node, Node::RepeatTo(_)) => match (node, problem.repeated) {
                (Node::RepeatFrom(_), _) => self.jump(from, to, prices, ends, start),
                (Node::Point(place), Some(repeated)) if place == repeated.from => {
                    self.jump(from, to, prices, ends, start)
                }
                _ => impossible,
            },
            (node, Node::Point(_) | Node::RepeatFrom(_)) if node.place() != self.nodes[to].place() => {
                self.jump(from, to, prices, ends, start)
            }
            _ => impossible,
        }
    }

    /// The largest weight of a jump: its gradient, plus the price received at its end, minus the price paid at its start.
    fn jump(
        &self,
        from: usize,
        to: usize,
        prices: &[Price],
        ends: EndPricing,
        start: Option<(f64, f64)>,
    ) -> JumpWeight {
        let mut best = JumpWeight { weight_k: IMPOSSIBLE_K, state: (0.0, 0.0) };
        let (Some(place), Some(next)) = (self.nodes[from].place(), self.nodes[to].place()) else {
            return best;
        };
        let problem = self.problem;
        let (at, goal) = (problem.points[place], problem.points[next]);
        if !problem.housing.admissible(at, goal) {
            return best;
        }
        let response = &problem.housing.responses[goal];
        let w = problem.housing.responses[at].speed;
        let counts = matches!(self.nodes[to], Node::Point(_));
        let (paid, received) = (&prices[from], &prices[to]);
        let [end_c, end_t] = &response.end;
        let mut max_price_k = f64::NEG_INFINITY;
        let mut try_state = |c: f64, t: f64| {
            let mut price_k = 0.0;
            if ends != EndPricing::Last {
                price_k += received.at(end_c.at(c, t, w), end_t.at(c, t, w));
            }
            if start.is_none() {
                price_k -= paid.at(c, t);
            }
            let gradient_k = if counts { response.gradient_k.at(c, t, w).abs() } else { 0.0 };
            max_price_k = max_price_k.max(price_k);
            if gradient_k + price_k > best.weight_k {
                best = JumpWeight { weight_k: gradient_k + price_k, state: (c, t) };
            }
        };
        if let Some((c, t)) = start {
            try_state(c, t);
            return best;
        }
        let ((c_low, c_high), (t_low, t_high)) = problem.boxes[place];
        for t in [t_low, t_high] {
            for knot in 0..KNOTS {
                let c = paid.knot(knot);
                try_state(c, t);
                // The end temperatures at the two limits of Tt may enclose a knot of the received price.
                if t == t_low {
                    self.try_interior_knots(c, (t_low, t_high), end_c, w, received, &mut try_state);
                }
            }
            for knot in 1..KNOTS - 1 {
                let before = invert_end_temperature(end_c, received.knot(knot), t, w);
                if before > c_low && before < c_high {
                    try_state(before, t);
                }
            }
        }
        // Between corners, a quadratic exceeds its chord by at most a quarter of its second coefficient times the square of the length.
        let bend_k = if counts { response.gradient_k.0[4].abs() } else { 0.0 }
            + received.steepest_k() * end_c.0[4].abs()
            + received.slope_k.abs() * end_t.0[4].abs();
        let allowed_k = 0.25 * bend_k * paid.spacing * paid.spacing;
        let max_k = problem.housing.gradient_max_k() + max_price_k;
        best.weight_k = (best.weight_k + allowed_k).min(max_k + allowed_k);
        best
    }

    /// Tries the states at `c`, within the Tt range, that end at a knot of the received price.
    fn try_interior_knots(
        &self,
        c: f64,
        (t_low, t_high): (f64, f64),
        end_c: &Surface,
        w: f64,
        received: &Price,
        try_state: &mut impl FnMut(f64, f64),
    ) {
        let (end_at_low, end_at_high) = (end_c.at(c, t_low, w), end_c.at(c, t_high, w));
        let (low, high) = (end_at_low.min(end_at_high), end_at_low.max(end_at_high));
        let (first, last) = (received.piece(low).0 + 1, received.piece(high).0);
        for knot in first..=last {
            let t =
                t_low + (t_high - t_low) * (received.knot(knot) - end_at_low) / (end_at_high - end_at_low);
            if t > t_low && t < t_high {
                try_state(c, t);
            }
        }
    }

    /// Makes one step against the subgradient: if a visit ends in one state and the next jump starts from another, the prices of both
    /// change.
    fn descend(
        &self,
        prices: &mut [Price],
        slope: &mut [Price],
        table: &[JumpWeight],
        successor: &[usize],
        excess_k: f64,
    ) {
        let n = self.nodes.len();
        for slope in slope.iter_mut() {
            slope.knots_k.iter_mut().for_each(|knot| *knot *= MEMORY);
            slope.slope_k *= MEMORY;
        }
        for (from, &to) in successor.iter().enumerate() {
            let state = table[from * n + to].state;
            if from == to {
                continue;
            }
            let (Some(next), start) = (self.nodes[to].place(), self.nodes[from].place()) else {
                slope[from].add(state, -1.0);
                continue;
            };
            let Some(place) = start else {
                slope[to].add(state, 1.0);
                continue;
            };
            let housing = self.problem.housing;
            let w = housing.responses[self.problem.points[place]].speed;
            let [end_c, end_t] = &housing.responses[self.problem.points[next]].end;
            let end = (end_c.at(state.0, state.1, w), end_t.at(state.0, state.1, w));
            slope[to].add(end, 1.0);
            slope[from].add(state, -1.0);
        }
        let square = |price: &Price| price.knots_k.iter().map(|k| k * k).sum::<f64>() + price.slope_k.powi(2);
        let total: f64 = slope.iter().map(square).sum();
        if total <= 0.0 {
            return;
        }
        let length = excess_k / total;
        for (price, slope) in prices.iter_mut().zip(slope.iter()) {
            price.knots_k.iter_mut().zip(slope.knots_k).for_each(|(knot, slope)| *knot -= length * slope);
            price.slope_k -= length * slope.slope_k;
        }
    }

    /// Bounds orders that return to their first point. The first jump starts from the state after the warm-up, so the prices of the
    /// first point do not cancel. For each possible first point, the jumps from it and to it are therefore weighted without its prices.
    fn bound_with_return_k(&self, prices: &[Price], bound_k: f64) -> f64 {
        let n = self.nodes.len();
        let table = self.table(prices);
        let weight_k = |first: usize, from: usize, to: usize| {
            if from == first {
                self.weight(from, to, prices, EndPricing::First).weight_k
            } else if to == first {
                self.weight(from, to, prices, EndPricing::Last).weight_k
            } else {
                table[from * n + to].weight_k
            }
        };
        // An assignment gains at most the gain of its two changed jumps.
        let gain_k = |first: &usize| {
            let gain_k = |from: usize, to: usize| {
                let before_k = table[from * n + to].weight_k;
                if before_k <= IMPOSSIBLE_K {
                    f64::NEG_INFINITY
                } else {
                    weight_k(*first, from, to) - before_k
                }
            };
            let largest = |gains: &mut dyn Iterator<Item = f64>| gains.fold(f64::NEG_INFINITY, f64::max);
            largest(&mut (0..n).map(|to| gain_k(*first, to)))
                + largest(&mut (0..n).map(|from| gain_k(from, *first)))
        };
        let points: Vec<usize> = (0..self.problem.counted).collect();
        let gains_k = parallel::map(&points, gain_k);
        let mut firsts: Vec<(f64, usize)> =
            gains_k.into_iter().map(|gain_k| bound_k + gain_k).zip(points).collect();
        firsts.sort_by(|a, b| b.0.total_cmp(&a.0));
        let solve = |(_, first): &(f64, usize)| {
            let weights_k: Vec<f64> = (0..n * n).map(|at| weight_k(*first, at / n, at % n)).collect();
            solve_assignment(n, |from, to| weights_k[from * n + to]).0
        };
        let (solved, others) = firsts.split_at(firsts.len().min(MAX_EXACT_FIRST_POINTS));
        let bound_of_others_k = others.first().map_or(f64::NEG_INFINITY, |first| first.0);
        parallel::map(solved, solve).into_iter().fold(bound_of_others_k, f64::max)
    }
}

/// Ends of a jump that have a price.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EndPricing {
    /// Both ends.
    Priced,
    /// Only the end: the first jump of an order starts from the state after the warm-up.
    First,
    /// Only the start: the last jump returns to the first point.
    Last,
}

/// The state with the lowest price, in which an order ends.
fn find_lowest_price(price: &Price, (_, (t_low, t_high)): StateBox) -> JumpWeight {
    let corners = (0..KNOTS).flat_map(|knot| [t_low, t_high].map(|t| (price.knot(knot), t)));
    corners.map(|(c, t)| JumpWeight { weight_k: -price.at(c, t), state: (c, t) }).fold(
        JumpWeight { weight_k: f64::NEG_INFINITY, state: (0.0, 0.0) },
        |best, other| {
            if other.weight_k > best.weight_k { other } else { best }
        },
    )
}

/// The scaled Tc from which a step ends at `end`; NaN if there is none near the range.
fn invert_end_temperature(surface: &Surface, end: f64, t: f64, w: f64) -> f64 {
    let k = &surface.0;
    let offset = k[0] + k[2] * t + k[3] * w - end;
    // The root of k4 c^2 + k1 c + offset that is -offset/k1 for a straight line.
    let root = (k[1] * k[1] - 4.0 * k[4] * offset).sqrt();
    -2.0 * offset / (k[1] + root.copysign(k[1]))
}
