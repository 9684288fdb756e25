//! Searches for a good order among promising successors.
//!
//! A move swaps two points, reverses a short piece, or moves a piece elsewhere. Half of the moves are random; the others create a jump
//! that the assignment of successors (`candidates`) favours. The effect of a move is computed from the first changed step until the
//! housing has forgotten the change: a few steps, whatever the length of the order.

use crate::housing::{Chain, Housing, sum_k, value_k};
use crate::request::PlanRequest;
use mapper_core::{OperatingPoint, VisitOrder};
use mapper_numerics::parallel;
use mapper_numerics::statistics::nearest_rank;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Maximum length of a reversed piece, and of the distance of a short move: longer ones cost more and rarely improve the order.
const MAX_PIECE_LENGTH: usize = 50;

/// Above this many points a search makes a single start.
const MANY_POINTS: usize = 500;
/// Distance of the random seeds of two campaigns, whose own seeds are small integers: their starts must not share seeds.
const SEED_STRIDE: u64 = 1_000_003;

/// Amount of work of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Moves tried in each start.
    pub moves: u64,
    /// Starts.
    pub starts: u64,
}

impl Effort {
    /// Usual effort: a fraction of a second for 50 points, some seconds for 2000. `factor` scales the moves: ten times as many increase the sum by
    /// less than 0.3 % (docs/explanation/planner.md).
    pub fn usual(points: usize, factor: f64) -> Self {
        let (moves, starts) = match points {
            0..=40 => (10_000.0, 16),
            // Repeats change the ranking of the orders, so several of them are useful.
            41..=100 => (1_000.0 * points as f64, 8),
            101..=MANY_POINTS => (1_000.0 * points as f64, 2),
            _ => (1_000.0 * points as f64, 1),
        };
        Effort { moves: (moves * factor.clamp(0.0, 1e4)) as u64, starts }
    }
}

/// Orders of the `given` points, the best first. Several are returned because repeats may change their ranking.
pub(crate) fn search_orders(
    housing: &Housing,
    points: &[OperatingPoint],
    given: &[usize],
    request: &PlanRequest<'_>,
) -> Vec<Vec<usize>> {
    match request.order {
        VisitOrder::Listed => vec![given.to_vec()],
        VisitOrder::SpeedLines | VisitOrder::Conventional => {
            let mut order = given.to_vec();
            order.sort_by(|a, b| compare_along_speed_lines(&points[*a], &points[*b]));
            vec![order]
        }
        VisitOrder::ThermalGradient => {
            search(housing, given, Effort::usual(given.len(), request.effort), request.seed)
        }
    }
}

/// Order along speed lines: by speed, and on each line from the widest opening to the narrowest.
fn compare_along_speed_lines(a: &OperatingPoint, b: &OperatingPoint) -> std::cmp::Ordering {
    let by_opening = b.valve_opening_ratio.total_cmp(&a.valve_opening_ratio);
    a.speed_rpm.total_cmp(&b.speed_rpm).then(by_opening)
}

/// Returns the best order of each start, by the sum of its gradients. No order is worse than `given`.
pub fn search<C: Chain + Sync>(chain: &C, given: &[usize], effort: Effort, seed: u64) -> Vec<Vec<usize>> {
    if given.len() < 2 {
        return vec![given.to_vec()];
    }
    let candidates = Candidates::new(chain, given);
    let greedy = build_greedy_order(chain, given);
    let starts: Vec<u64> = (0..effort.starts.max(1)).collect();
    let run_from = |start: &u64| {
        let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(SEED_STRIDE).wrapping_add(*start));
        let mut best = given.to_vec();
        let mut best_k = sum_k(chain, &best);
        Annealing::new(chain, &candidates, &greedy).run(effort.moves, &mut random, &mut best, &mut best_k);
        (best_k, best)
    };
    let mut found = parallel::map(&starts, run_from);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, order)| order).collect()
}

/// Builds an order that continues at each position with the point of highest value.
fn build_greedy_order<C: Chain>(chain: &C, given: &[usize]) -> Vec<usize> {
    let mut remaining = given.to_vec();
    let mut order = Vec::with_capacity(given.len());
    let mut state = None;
    while !remaining.is_empty() {
        let next = match (state, order.last()) {
            (Some(state), Some(&from)) => {
                let value_k = |to: usize| value_k(chain, from, to, chain.step(from, to, state).0);
                let mut best = (0, f64::NEG_INFINITY);
                for (index, &to) in remaining.iter().enumerate() {
                    let value_k = value_k(to);
                    if value_k > best.1 {
                        best = (index, value_k);
                    }
                }
                best.0
            }
            _ => 0,
        };
        // `remove` keeps the listed order of the remaining points, so the first listed wins a tie.
        let to = remaining.remove(next);
        state = Some(match (state, order.last()) {
            (Some(state), Some(&from)) => chain.step(from, to, state).1,
            _ => chain.first(to),
        });
        order.push(to);
    }
    order
}

/// Positions `start..end` of an order, as part of a new one.
#[derive(Debug, Clone, Copy)]
struct Piece {
    start: usize,
    end: usize,
    reversed: bool,
}

fn forward_piece(start: usize, end: usize) -> Piece {
    Piece { start, end, reversed: false }
}

/// State before a step, and the step's value.
type StepState<S> = (Option<S>, f64);

struct Annealing<'a, C: Chain> {
    chain: &'a C,
    candidates: &'a Candidates,
    order: Vec<usize>,
    /// Position of each point of the chain in the order; undefined for other points.
    position_of: Vec<usize>,
    /// State before each position's step and its value. Position 0 has no state; the entry after the last position holds the final
    /// state and the value of the return jump.
    step_states: Vec<StepState<C::State>>,
    /// The proposed order from position `begin` on; the points after the pieces keep their order.
    pieces: Vec<Piece>,
    begin: usize,
    /// Changed steps of the proposal, by new position.
    log: Vec<(usize, StepState<C::State>)>,
    scratch: Vec<(usize, StepState<C::State>)>,
}

impl<'a, C: Chain> Annealing<'a, C> {
    fn new(chain: &'a C, candidates: &'a Candidates, order: &[usize]) -> Self {
        let mut annealing = Annealing {
            chain,
            candidates,
            order: order.to_vec(),
            position_of: vec![0; chain.len()],
            step_states: vec![(None, 0.0); order.len() + 1],
            pieces: Vec::new(),
            begin: 0,
            log: Vec::new(),
            scratch: Vec::new(),
        };
        for (position, point) in order.iter().enumerate() {
            annealing.position_of[*point] = position;
        }
        annealing.refresh();
        annealing
    }

    fn refresh(&mut self) {
        let mut state = None;
        for k in 0..self.order.len() {
            let (value, next) =
                self.evaluate_step(k.checked_sub(1).map(|p| self.order[p]), self.order[k], state);
            self.step_states[k] = (state, value);
            state = Some(next);
        }
        let ends = self.order.first().copied().zip(self.order.last().copied());
        self.step_states[self.order.len()] = (state, self.return_jump(ends, state));
    }

    /// Value of the jump from the last point back to the first, if there is one.
    #[inline]
    fn return_jump(&self, ends: Option<(usize, usize)>, state: Option<C::State>) -> f64 {
        match (ends, state) {
            (Some((first, last)), Some(state)) if self.chain.has_return() && first != last => {
                self.evaluate_step(Some(last), first, Some(state)).0
            }
            _ => 0.0,
        }
    }

    #[inline]
    fn evaluate_step(&self, from: Option<usize>, to: usize, state: Option<C::State>) -> (f64, C::State) {
        match (from, state) {
            (Some(from), Some(state)) => {
                let (gradient_k, next) = self.chain.step(from, to, state);
                (value_k(self.chain, from, to, gradient_k), next)
            }
            _ => (0.0, self.chain.first(to)),
        }
    }

    /// Returns the gain of the proposed pieces, and stores the new states and values in the log.
    fn evaluate_proposal(&mut self) -> f64 {
        self.log.clear();
        let n = self.order.len();
        if self.pieces.is_empty() {
            return 0.0;
        }
        let mut gain = 0.0;
        let mut state = self.step_states[self.begin].0;
        let mut from = self.begin.checked_sub(1).map(|p| self.order[p]);
        let mut position = self.begin;
        let rest = self.pieces.iter().map(|piece| piece.end).max().unwrap_or(n);
        for index in 0..=self.pieces.len() {
            let piece = self.pieces.get(index).copied().unwrap_or_else(|| forward_piece(rest, n));
            let mut done = 0;
            while done < piece.end - piece.start {
                let k = if piece.reversed { piece.end - 1 - done } else { piece.start + done };
                let (old_state, old_value) = self.step_states[k];
                if !piece.reversed
                    && let (Some(new), Some(old), Some(p)) = (state, old_state, k.checked_sub(1))
                    && from == Some(self.order[p])
                    && self.chain.is_indistinguishable(new, old)
                {
                    // The housing has forgotten the change: the rest of the piece is unchanged.
                    position += piece.end - k;
                    state = self.step_states[piece.end].0;
                    from = Some(self.order[piece.end - 1]);
                    break;
                }
                let to = self.order[k];
                let (value, next) = self.evaluate_step(from, to, state);
                gain += value - old_value;
                self.log.push((position, (state, value)));
                (state, from) = (Some(next), Some(to));
                position += 1;
                done += 1;
            }
        }
        let first = match self.pieces.first() {
            Some(piece) if self.begin == 0 => {
                if piece.reversed {
                    self.order[piece.end - 1]
                } else {
                    self.order[piece.start]
                }
            }
            _ => self.order[0],
        };
        let return_value = self.return_jump(from.map(|last| (first, last)), state);
        gain += return_value - self.step_states[n].1;
        self.log.push((n, (state, return_value)));
        gain
    }

    fn accept(&mut self) {
        // Copy only the points whose position changes: the ends of a swap may be far apart.
        self.scratch.clear();
        let mut position = self.begin;
        for piece in &self.pieces {
            let length = piece.end - piece.start;
            if piece.reversed || piece.start != position {
                for done in 0..length {
                    let k = if piece.reversed { piece.end - 1 - done } else { piece.start + done };
                    self.scratch.push((self.order[k], self.step_states[k]));
                }
            }
            position += length;
        }
        let (mut position, mut next) = (self.begin, 0);
        for piece in &self.pieces {
            let length = piece.end - piece.start;
            if piece.reversed || piece.start != position {
                for k in position..position + length {
                    let (point, known) = self.scratch[next];
                    (self.order[k], self.step_states[k], self.position_of[point]) = (point, known, k);
                    next += 1;
                }
            }
            position += length;
        }
        for &(k, known) in &self.log {
            self.step_states[k] = known;
        }
    }

    fn set_proposal(&mut self, begin: usize, pieces: &[Piece]) {
        self.begin = begin;
        self.pieces.clear();
        self.pieces.extend(pieces.iter().filter(|piece| piece.start < piece.end));
    }

    fn propose_swap(&mut self, a: usize, b: usize) {
        let (low, high) = (a.min(b), a.max(b));
        if low < high {
            let ends =
                [forward_piece(high, high + 1), forward_piece(low + 1, high), forward_piece(low, low + 1)];
            self.set_proposal(low, &ends);
        }
    }

    /// Moves the piece `start..end` to position `to`, which lies outside of it.
    fn propose_shift(&mut self, start: usize, end: usize, to: usize, reversed: bool) {
        let piece = Piece { start, end, reversed };
        if to < start {
            self.set_proposal(to, &[piece, forward_piece(to, start)]);
        } else if to > end {
            self.set_proposal(start, &[forward_piece(end, to), piece]);
        } else if reversed {
            self.set_proposal(start, &[piece]);
        }
    }

    /// Draws a move. The proposal stays empty if the move would change nothing.
    fn propose(&mut self, random: &mut Pcg64Mcg) {
        self.pieces.clear();
        let n = self.order.len();
        let i = random.random_range(0..n);
        let kind: u32 = random.random_range(0..20);
        if kind < 10 && self.propose_guided(i, kind, random) {
            return;
        }
        match kind % 10 {
            0..4 => {
                let j = random.random_range(0..n);
                self.propose_swap(i, j);
            }
            4..6 => {
                let end = (i + 2 + random.random_range(0..MAX_PIECE_LENGTH)).min(n);
                self.set_proposal(i, &[Piece { start: i, end, reversed: true }]);
            }
            _ => {
                let end = (i + random.random_range(1..=3usize)).min(n);
                let max_distance = MAX_PIECE_LENGTH.min(n);
                let to = if random.random::<bool>() {
                    random.random_range(0..=n)
                } else {
                    (i + random.random_range(0..=2 * max_distance)).saturating_sub(max_distance).min(n)
                };
                if !(i..=end).contains(&to) {
                    self.propose_shift(i, end, to, kind.is_multiple_of(4));
                }
            }
        }
    }

    /// Proposes a move after which a candidate follows the point at `i`. Returns whether there is one.
    fn propose_guided(&mut self, i: usize, kind: u32, random: &mut Pcg64Mcg) -> bool {
        let n = self.order.len();
        let Some(to) = self.candidates.draw(self.order[i], random) else { return false };
        let q = self.position_of[to];
        if q == i + 1 || q == i {
            return false;
        }
        // Usually a few points, sometimes a long piece, never reversed.
        let length = match random.random_range(0..4u32) {
            0 => random.random_range(1..=n),
            _ => random.random_range(1..=3usize),
        };
        match kind % 3 {
            0 if i + 1 < n => self.propose_swap(i + 1, q),
            // Move the piece that begins with the candidate to the position after this point.
            1 => {
                let end = (q + length).min(if q < i { i } else { n });
                self.propose_shift(q, end, i + 1, false);
            }
            // Move the piece that ends with this point to the position before the candidate.
            _ => {
                let start = (i + 1).saturating_sub(length).max(if q < i { q + 1 } else { 0 });
                self.propose_shift(start, i + 1, q, false);
            }
        }
        !self.pieces.is_empty()
    }

    fn run(&mut self, moves: u64, random: &mut Pcg64Mcg, best: &mut Vec<usize>, best_k: &mut f64) {
        // Typical change of value, from trial moves.
        let sizes: Vec<f64> = (0..200)
            .map(|_| {
                self.propose(random);
                self.evaluate_proposal().abs()
            })
            .filter(|size| *size > 0.0 && *size < 1e5)
            .collect();
        let typical = nearest_rank(&sizes, 0.5).unwrap_or(1.0);
        let (hottest, coldest) = (0.5 * typical, 5e-4 * typical);
        const STAGES: u64 = 200;
        for stage in 0..STAGES {
            let share = stage as f64 / (STAGES - 1) as f64;
            let temperature = hottest * (coldest / hottest).powf(share);
            for _ in 0..moves / STAGES {
                self.propose(random);
                let gain = self.evaluate_proposal();
                if gain >= 0.0 || gain > temperature * random.random::<f64>().ln() {
                    self.accept();
                }
            }
            // Recompute, so that differences neglected as indistinguishable do not accumulate.
            self.refresh();
            let sum_k = sum_k(self.chain, &self.order);
            if sum_k > *best_k {
                *best_k = sum_k;
                best.clone_from(&self.order);
            }
        }
    }
}

const MAX_SUCCESSORS: usize = 10;
/// Maximum number of points with candidates: the table of weights grows with its square.
const MAX_POINTS: usize = 4000;
/// Lower limit of a weight: the assignment needs finite weights for forbidden jumps.
const MIN_VALUE: f64 = -1e9;

/// The best successors of each point of a chain.
pub(crate) struct Candidates {
    successors: Vec<Vec<usize>>,
}

impl Candidates {
    pub(crate) fn new<C: Chain>(chain: &C, given: &[usize]) -> Self {
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
                value_k(chain, from, to, chain.step(from, to, state).0).max(MIN_VALUE)
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

/// Ratio of each increment to the one before.
const INCREMENT_RATIO: f64 = 0.2;
/// Maximum number of bids for each row in a round, so that an auction ends for any weights.
const MAX_BIDS_PER_ROW: usize = 60;

struct Prices {
    /// Largest profit of each row at these prices: `max_j weight(i, j) - price(j)`.
    profit: Vec<f64>,
    price: Vec<f64>,
}

/// Finds prices for the assignment with the largest total of `weight`, a table of `n` rows and `n` columns.
///
/// `increments`: the first and the last. At the end each row is content within the last.
fn run_auction(n: usize, weight: &[f64], increments: (f64, f64)) -> Prices {
    let mut price = vec![0.0f64; n];
    let (mut increment, last) = increments;
    // A single row has no competitor.
    let mut has_next_round = n > 1;
    while has_next_round {
        let mut row_of: Vec<Option<usize>> = vec![None; n];
        let mut unassigned: Vec<usize> = (0..n).rev().collect();
        let mut bids_left = MAX_BIDS_PER_ROW * n;
        while let Some(row) = unassigned.pop() {
            if bids_left == 0 {
                break;
            }
            bids_left -= 1;
            let (mut best, mut second, mut column) = (f64::NEG_INFINITY, f64::NEG_INFINITY, 0);
            for (j, (weight, price)) in weight[n * row..n * (row + 1)].iter().zip(&price).enumerate() {
                let profit = weight - price;
                if profit > second {
                    if profit > best {
                        (second, best, column) = (best, profit, j);
                    } else {
                        second = profit;
                    }
                }
            }
            price[column] += best - second + increment;
            unassigned.extend(row_of[column].replace(row));
        }
        has_next_round = increment > last;
        increment = (increment * INCREMENT_RATIO).max(last);
    }
    let profit: Vec<f64> = (0..n)
        .map(|i| {
            let row = weight[n * i..n * (i + 1)].iter().zip(&price);
            row.map(|(weight, price)| weight - price).fold(f64::NEG_INFINITY, f64::max)
        })
        .collect();
    Prices { profit, price }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::housing::gradients_k;
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
            return gradients_k(chain, path).iter().sum();
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
            let found = search(&chain, &given, Effort { moves: 20_000, starts: 2 }, 7).swap_remove(0);
            prop_assert!((sum_k(&chain, &found) - best).abs() < 1e-9);
            // Include the return to the first point.
            chain.has_return = true;
            let best = best_of_all(&chain, &mut Vec::new());
            let found = search(&chain, &given, Effort { moves: 20_000, starts: 2 }, 7).swap_remove(0);
            prop_assert!((sum_k(&chain, &found) - best).abs() < 1e-9);
        }
    }
}

#[cfg(test)]
mod candidates_tests {
    use super::*;
    use proptest::prelude::*;

    fn best_total(weight: &[f64], n: usize, row: usize, used: &mut Vec<usize>) -> f64 {
        if row == n {
            return 0.0;
        }
        let mut best = f64::NEG_INFINITY;
        for column in 0..n {
            if !used.contains(&column) {
                used.push(column);
                best = best.max(weight[n * row + column] + best_total(weight, n, row + 1, used));
                used.pop();
            }
        }
        best
    }

    proptest! {
        /// By duality the profits and prices exceed the best assignment, by at most one increment for each row.
        #[test]
        fn the_prices_are_those_of_the_best_assignment(
            weights in prop::collection::vec(0.0..30.0f64, 36),
            n in 2usize..=6,
        ) {
            let weight = &weights[..n * n];
            let best = best_total(weight, n, 0, &mut Vec::new());
            let Prices { profit, price } = run_auction(n, weight, (10.0, 0.01));
            let found = profit.iter().sum::<f64>() + price.iter().sum::<f64>();
            prop_assert!(found >= best - 1e-9 && found <= best + 0.01 * n as f64 + 1e-9, "{found} {best}");
        }
    }
}
