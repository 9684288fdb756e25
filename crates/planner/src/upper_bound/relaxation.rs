//! The sum of gradients that no order exceeds, by Lagrangian relaxation.
//!
//! The best assignment of successors bounds the sum if each jump may start from the state that suits it best. That is loose when the
//! housing remembers much: a visit may then end in one state and be left in another. Here each visit has a price for the state it is
//! left in, which is paid when it is left and received when it is reached. Along an order the prices cancel, so that the bound holds
//! for any of them; the subgradient method finds prices under which it is small (Fisher, Management Science 27:1, 1981).
//!
//! A price is piecewise linear in Tc and linear in Tt. Gradients and states are convex or affine on each piece, up to a small
//! quadratic part that is allowed for, so that the largest weight of a jump is found at the corners of the pieces.

use crate::thermal_memory::chain::Chain;
use crate::thermal_memory::housing::{Housing, StateBox, Surface};
use crate::upper_bound::assignment::largest_assignment;
use mapper_numerics::parallel;

/// Knots of a price over the box of a visit: more of them lower the bound of turbo_a by less than 0.2 %.
const KNOTS: usize = 7;
/// Iterations, and pairs of visits that all of them look at together: some tenths of a second. A hundred more lower the bound of
/// turbo_a by 0.2 %.
const MAX_ITERATIONS: usize = 100;
const MAX_PAIRS: usize = 1_000_000;
/// The first step over Polyak's, how it falls after so many iterations without a smaller bound, and the share of the direction before
/// that each direction keeps (Camerini, Fratta and Maffioli, Mathematical Programming Study 3:26, 1975). Any values give a bound; these gave
/// the smallest of turbo_a after 100 iterations.
const FIRST_STEP: f64 = 0.7;
const STEP_FALL: f64 = 0.7;
const PATIENCE: usize = 4;
const MEMORY: f64 = 0.5;
/// First points whose assignment is solved, those with the largest bounds; the bound of the next one holds for all others.
const MAX_FIRSTS: usize = 32;
/// Weight of a jump that is not possible, K: no sum of gradients makes up for it.
const IMPOSSIBLE_K: f64 = -1e9;

/// The repeated jump: the places of its ends among the visited points, and how often it is made.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Repeated {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) count: usize,
}

/// What is visited.
pub(crate) struct Visited<'a> {
    pub(crate) housing: &'a Housing,
    /// Points of the housing; those from `counted` on are visited by repeats alone.
    pub(crate) points: &'a [usize],
    pub(crate) counted: usize,
    /// The states that a dwell at each point can end in.
    pub(crate) boxes: &'a [StateBox],
    pub(crate) repeated: Option<Repeated>,
    /// Whether the order ends with a jump back to its first point.
    pub(crate) returns: bool,
}

/// What a node of the relaxation stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Node {
    /// The visit of a point that counts, by its place.
    Point(usize),
    /// A visit of the start of the repeated jump for its sake; need not be made.
    RepeatFrom(usize),
    /// A repeat.
    RepeatTo(usize),
    /// Before the first and behind the last visit.
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

/// Price of the state in which a visit is left, K.
#[derive(Debug, Clone, Copy)]
struct Price {
    low: f64,
    spacing: f64,
    /// At knots that are evenly spaced over the box of scaled Tc.
    knots_k: [f64; KNOTS],
    /// By scaled Tt.
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

    /// Largest slope by scaled Tc, K.
    fn steepest_k(&self) -> f64 {
        let slopes = self.knots_k.windows(2).map(|pair| (pair[1] - pair[0]).abs() / self.spacing);
        slopes.fold(0.0, f64::max)
    }

    /// Moves the price of a state.
    fn add(&mut self, (c, t): (f64, f64), by_k: f64) {
        let (below, x) = self.piece(c);
        self.knots_k[below] += by_k * (1.0 - x);
        self.knots_k[below + 1] += by_k * x;
        self.slope_k += by_k * t;
    }
}

/// The weight of a jump and the state in which it is largest.
#[derive(Debug, Clone, Copy)]
struct Best {
    weight_k: f64,
    state: (f64, f64),
}

/// The largest sum of gradients of any order of the visited points, or somewhat more; `found_k` is that of an order.
pub(crate) fn bounded_sum_k(visited: &Visited<'_>, found_k: f64) -> f64 {
    let nodes = nodes(visited);
    let relaxation = Relaxation { visited, nodes: &nodes };
    let mut prices: Vec<Price> = nodes
        .iter()
        .map(|node| Price::zero(node.place().map_or((0.0, 1.0), |place| visited.boxes[place].0)))
        .collect();
    let pairs = nodes.len() * nodes.len();
    let iterations = (MAX_PAIRS / pairs.max(1)).min(MAX_ITERATIONS);
    let (mut bound_k, mut best_prices) = (f64::INFINITY, prices.clone());
    let (mut step, mut waited) = (FIRST_STEP, 0);
    let mut direction: Vec<Price> = prices.clone();
    for _ in 0..=iterations {
        let table = relaxation.table(&prices);
        let weight = |from: usize, to: usize| table[from * nodes.len() + to].weight_k;
        let (sum_k, successor) = largest_assignment(nodes.len(), weight);
        if sum_k < bound_k - 1e-6 * sum_k.abs() {
            (bound_k, waited) = (sum_k, 0);
            best_prices.clone_from(&prices);
        } else {
            waited += 1;
            if waited == PATIENCE {
                (step, waited) = (step * STEP_FALL, 0);
                prices.clone_from(&best_prices);
                continue;
            }
        }
        if sum_k - found_k <= 1e-3 * found_k.abs() {
            break;
        }
        relaxation.descend(&mut prices, &mut direction, &table, &successor, step * (sum_k - found_k));
    }
    if visited.returns { relaxation.with_start(&best_prices, bound_k) } else { bound_k }
}

fn nodes(visited: &Visited<'_>) -> Vec<Node> {
    let mut nodes: Vec<Node> = (0..visited.counted).map(Node::Point).collect();
    if let Some(Repeated { from, to, count }) = visited.repeated {
        nodes.extend((0..count).flat_map(|_| [Node::RepeatFrom(from), Node::RepeatTo(to)]));
    }
    if !visited.returns {
        nodes.push(Node::Outside);
    }
    nodes
}

struct Relaxation<'a> {
    visited: &'a Visited<'a>,
    nodes: &'a [Node],
}

impl Relaxation<'_> {
    /// The weight of each jump, row after row.
    fn table(&self, prices: &[Price]) -> Vec<Best> {
        let rows: Vec<usize> = (0..self.nodes.len()).collect();
        let row = |from: &usize| -> Vec<Best> {
            (0..self.nodes.len()).map(|to| self.weight(*from, to, prices, Ends::Priced)).collect()
        };
        parallel::map(&rows, row).into_iter().flatten().collect()
    }

    fn weight(&self, from: usize, to: usize, prices: &[Price], ends: Ends) -> Best {
        let impossible = Best { weight_k: IMPOSSIBLE_K, state: (0.0, 0.0) };
        let visited = self.visited;
        let first = |place: usize| {
            let [c, t] = visited.housing.first(visited.points[place]);
            (c, t)
        };
        let start = self.nodes[from].place().filter(|_| ends == Ends::First).map(first);
        match (self.nodes[from], self.nodes[to]) {
            // A visit for the sake of a repeat that need not be made.
            (Node::RepeatFrom(_), Node::RepeatFrom(_)) if from == to => Best { weight_k: 0.0, ..impossible },
            (Node::Outside, Node::Point(place)) => {
                let state = first(place);
                Best { weight_k: prices[to].at(state.0, state.1), state }
            }
            (Node::Outside, _) => impossible,
            (node, Node::Outside) => match node.place() {
                Some(place) if !matches!(node, Node::RepeatFrom(_)) => {
                    lowest_price(&prices[from], visited.boxes[place])
                }
                _ => impossible,
            },
            (Node::RepeatFrom(_), Node::Point(_) | Node::RepeatFrom(_)) => impossible,
            (node, Node::RepeatTo(_)) => match (node, visited.repeated) {
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

    /// The largest gradient of a jump, with the price that is received at its end and without the one that is paid at its start.
    fn jump(&self, from: usize, to: usize, prices: &[Price], ends: Ends, start: Option<(f64, f64)>) -> Best {
        let mut best = Best { weight_k: IMPOSSIBLE_K, state: (0.0, 0.0) };
        let (Some(place), Some(next)) = (self.nodes[from].place(), self.nodes[to].place()) else {
            return best;
        };
        let visited = self.visited;
        let (at, goal) = (visited.points[place], visited.points[next]);
        if !visited.housing.admissible(at, goal) {
            return best;
        }
        let response = &visited.housing.responses[goal];
        let w = visited.housing.responses[at].speed;
        let counts = matches!(self.nodes[to], Node::Point(_));
        let (paid, received) = (&prices[from], &prices[to]);
        let [end_c, end_t] = &response.end;
        let mut without_k = f64::NEG_INFINITY;
        let mut look = |c: f64, t: f64| {
            let mut price_k = 0.0;
            if ends != Ends::Last {
                price_k += received.at(end_c.at(c, t, w), end_t.at(c, t, w));
            }
            if start.is_none() {
                price_k -= paid.at(c, t);
            }
            let gradient_k = if counts { response.gradient_k.at(c, t, w).abs() } else { 0.0 };
            without_k = without_k.max(price_k);
            if gradient_k + price_k > best.weight_k {
                best = Best { weight_k: gradient_k + price_k, state: (c, t) };
            }
        };
        if let Some((c, t)) = start {
            look(c, t);
            return best;
        }
        let ((c_low, c_high), (t_low, t_high)) = visited.boxes[place];
        for t in [t_low, t_high] {
            for knot in 0..KNOTS {
                let c = paid.knot(knot);
                look(c, t);
                // A knot of the price received may lie between the ends that this one leads to at both Tt.
                if t == t_low {
                    self.between(c, (t_low, t_high), end_c, w, received, &mut look);
                }
            }
            for knot in 1..KNOTS - 1 {
                let before = start_of(end_c, received.knot(knot), t, w);
                if before > c_low && before < c_high {
                    look(before, t);
                }
            }
        }
        // Between the corners a quadratic rises above its chord by a quarter of its second coefficient times the square of the length.
        let bend_k = if counts { response.gradient_k.0[4].abs() } else { 0.0 }
            + received.steepest_k() * end_c.0[4].abs()
            + received.slope_k.abs() * end_t.0[4].abs();
        let allowed_k = 0.25 * bend_k * paid.spacing * paid.spacing;
        let most_k = visited.housing.gradient_max_k() + without_k;
        best.weight_k = (best.weight_k + allowed_k).min(most_k + allowed_k);
        best
    }

    /// Looks where a knot of the price received is reached from `c` at some Tt of the range.
    fn between(
        &self,
        c: f64,
        (t_low, t_high): (f64, f64),
        end_c: &Surface,
        w: f64,
        received: &Price,
        look: &mut impl FnMut(f64, f64),
    ) {
        let (one, other) = (end_c.at(c, t_low, w), end_c.at(c, t_high, w));
        let (low, high) = (one.min(other), one.max(other));
        let (first, last) = (received.piece(low).0 + 1, received.piece(high).0);
        for knot in first..=last {
            let t = t_low + (t_high - t_low) * (received.knot(knot) - one) / (other - one);
            if t > t_low && t < t_high {
                look(c, t);
            }
        }
    }

    /// One step against the subgradient: where a visit is reached in another state than it is left, the prices of both move.
    fn descend(
        &self,
        prices: &mut [Price],
        slope: &mut [Price],
        table: &[Best],
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
            let housing = self.visited.housing;
            let w = housing.responses[self.visited.points[place]].speed;
            let [end_c, end_t] = &housing.responses[self.visited.points[next]].end;
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

    /// The bound of orders that return to their first point. That one is left in the state after the warm-up and reached in another
    /// one, so that its prices do not cancel: with each point as the first, the jumps from it and to it are weighted without them.
    fn with_start(&self, prices: &[Price], bound_k: f64) -> f64 {
        let n = self.nodes.len();
        let table = self.table(prices);
        let other_ends = |first: usize, from: usize, to: usize| {
            let ends = match () {
                () if from == first => Ends::First,
                () if to == first => Ends::Last,
                () => return table[from * n + to].weight_k,
            };
            self.weight(from, to, prices, ends).weight_k
        };
        // No assignment gains more than its two changed jumps do.
        let gain_k = |first: &usize| {
            let gain_k = |from: usize, to: usize| {
                let before_k = table[from * n + to].weight_k;
                if before_k <= IMPOSSIBLE_K {
                    f64::NEG_INFINITY
                } else {
                    other_ends(*first, from, to) - before_k
                }
            };
            let largest = |gains: &mut dyn Iterator<Item = f64>| gains.fold(f64::NEG_INFINITY, f64::max);
            largest(&mut (0..n).map(|to| gain_k(*first, to)))
                + largest(&mut (0..n).map(|from| gain_k(from, *first)))
        };
        let points: Vec<usize> = (0..self.visited.counted).collect();
        let gains_k = parallel::map(&points, gain_k);
        let mut firsts: Vec<(f64, usize)> =
            gains_k.into_iter().map(|gain_k| bound_k + gain_k).zip(points).collect();
        firsts.sort_by(|a, b| b.0.total_cmp(&a.0));
        let exactly = |(_, first): &(f64, usize)| {
            let changed: Vec<f64> = (0..n * n).map(|at| other_ends(*first, at / n, at % n)).collect();
            largest_assignment(n, |from, to| changed[from * n + to]).0
        };
        let (some, others) = firsts.split_at(firsts.len().min(MAX_FIRSTS));
        let of_others = others.first().map_or(f64::NEG_INFINITY, |first| first.0);
        parallel::map(some, exactly).into_iter().fold(of_others, f64::max)
    }
}

/// How the ends of a jump are priced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ends {
    /// Both.
    Priced,
    /// It is the first of the order, from the state after the warm-up.
    First,
    /// It is the last one, back to the first point.
    Last,
}

/// The end of an order: the state with the lowest price is left.
fn lowest_price(price: &Price, (_, (t_low, t_high)): StateBox) -> Best {
    let corners = (0..KNOTS).flat_map(|knot| [t_low, t_high].map(|t| (price.knot(knot), t)));
    corners.map(|(c, t)| Best { weight_k: -price.at(c, t), state: (c, t) }).fold(
        Best { weight_k: f64::NEG_INFINITY, state: (0.0, 0.0) },
        |best, other| {
            if other.weight_k > best.weight_k { other } else { best }
        },
    )
}

/// The scaled Tc from which a step ends at `end`; NaN if there is none near the box.
fn start_of(surface: &Surface, end: f64, t: f64, w: f64) -> f64 {
    let k = &surface.0;
    let offset = k[0] + k[2] * t + k[3] * w - end;
    // Of k4 c^2 + k1 c + offset the root that is -offset/k1 for a straight line.
    let root = (k[1] * k[1] - 4.0 * k[4] * offset).sqrt();
    -2.0 * offset / (k[1] + root.copysign(k[1]))
}
