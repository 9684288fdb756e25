//! Search for a good order under thermal memory: annealing with restarts, seeded, bounded by its number of moves.
//!
//! A move swaps two points, reverses a short stretch, or puts a stretch elsewhere, near or far. Half of the moves are
//! random; the others make a jump that the assignment of successors (`candidates`) thinks well of. A move is judged by
//! going through the steps it touches and on until the housing no longer remembers: a few steps, however long the order
//! is.

use crate::ordering::candidates::Candidates;
use crate::ordering::objective::Objective;
use crate::thermal_memory::chain::{Chain, gradients_k};
use mapper_numerics::parallel;
use mapper_numerics::statistics::nearest_rank;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Longest stretch that is reversed or shifted over: longer ones cost as much as they rarely gain.
const LONGEST_STRETCH: usize = 50;

/// Above this many points there is time for one start.
const MANY_POINTS: usize = 500;
/// Seeds of campaigns are small whole numbers: their starts lie apart by this.
const SEEDS_APART: u64 = 1_000_003;
/// Targets that a search for the largest smallest gradient sets itself.
const TARGETS: u64 = 10;
/// How much the second target lies above what the first has given, over the mean gradient of a greedy order; a target that
/// is not met halves the next rise.
const FIRST_RISE_RATIO: f64 = 0.1;

/// How much work a search does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Moves tried in each start.
    pub moves: u64,
    /// Starts.
    pub starts: u64,
}

impl Effort {
    /// A fraction of a second for 50 points, some seconds for 2000; `factor` scales the moves. Ten times as many find sums that are
    /// larger by less than 0.3 % (docs/explanation/planner.md).
    pub fn usual(points: usize, factor: f64) -> Self {
        let (moves, starts) = match points {
            0..=40 => (10_000.0, 16),
            // What repeats cost is seen when they are put into the orders that were found: the more of them the better.
            41..=100 => (1_000.0 * points as f64, 8),
            101..=MANY_POINTS => (1_000.0 * points as f64, 2),
            _ => (1_000.0 * points as f64, 1),
        };
        Effort { moves: (moves * factor.clamp(0.0, 1e4)) as u64, starts }
    }
}

/// The best order found from each start, the best of them first.
///
/// The first of `given` is a start too; no order found is worse than it.
pub fn search<C: Chain + Sync>(
    chain: &C,
    given: &[usize],
    objective: Objective,
    effort: Effort,
    seed: u64,
) -> Vec<Vec<usize>> {
    search_among(chain, &Candidates::of(chain, given, objective), given, objective, effort, seed)
}

fn search_among<C: Chain + Sync>(
    chain: &C,
    candidates: &Candidates,
    given: &[usize],
    objective: Objective,
    effort: Effort,
    seed: u64,
) -> Vec<Vec<usize>> {
    if given.len() < 2 {
        return vec![given.to_vec()];
    }
    let greedy = greedy(chain, given, objective);
    let starts: Vec<u64> = (0..effort.starts.max(1)).collect();
    let one = |start: &u64| {
        let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(SEEDS_APART).wrapping_add(*start));
        let mut best = given.to_vec();
        let mut best_figure = objective.figure(chain, &best);
        Annealing::new(chain, candidates, &greedy, objective).run(
            effort.moves,
            &mut random,
            &mut best,
            &mut best_figure,
        );
        (best_figure, best)
    };
    let mut found = parallel::map(&starts, one);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, order)| order).collect()
}

/// The order with the largest smallest gradient found from `given`: targets that rise as they are met.
pub fn search_worst<C: Chain + Sync>(chain: &C, given: &[usize], effort: Effort, seed: u64) -> Vec<usize> {
    let worst_k = |order: &[usize]| Objective::Worst { target_k: 0.0 }.figure(chain, order);
    let mut order = greedy(chain, given, Objective::Sum);
    let mean_k = gradients_k(chain, &order).iter().sum::<f64>() / (given.len() as f64 - 1.0).max(1.0);
    let mean_k = mean_k.min(chain.gradient_max_k());
    let candidates = Candidates::of(chain, given, Objective::Worst { target_k: mean_k });
    let (mut best_k, mut rise_k) = (worst_k(&order), mean_k);
    // Many points need more moves to agree on the smallest gradient than on their sum.
    let times = if given.len() > MANY_POINTS { 2 } else { 1 } * effort.starts.max(1);
    let each = Effort { moves: effort.moves.saturating_mul(times) / TARGETS, starts: 1 };
    for round in 0..TARGETS {
        let objective = Objective::Worst { target_k: best_k.max(0.0) + rise_k };
        let found = search_among(chain, &candidates, &order, objective, each, seed.wrapping_add(round))
            .swap_remove(0);
        let found_k = worst_k(&found);
        let risen_k = found_k - best_k;
        if risen_k > 0.0 {
            (order, best_k) = (found, found_k);
        }
        if round == 0 {
            rise_k = FIRST_RISE_RATIO * mean_k;
        } else if risen_k < 0.5 * rise_k {
            rise_k *= 0.5;
        }
    }
    order
}

/// At each position the point whose step has the highest value.
pub(crate) fn greedy<C: Chain>(chain: &C, given: &[usize], objective: Objective) -> Vec<usize> {
    let mut remaining = given.to_vec();
    let mut order = Vec::with_capacity(given.len());
    let mut state = None;
    while !remaining.is_empty() {
        let next = match (state, order.last()) {
            (Some(state), Some(&from)) => {
                let value = |to: usize| objective.value(chain, from, to, chain.step(from, to, state).0);
                let mut best = (0, f64::NEG_INFINITY);
                for (place, &to) in remaining.iter().enumerate() {
                    let value = value(to);
                    if value > best.1 {
                        best = (place, value);
                    }
                }
                best.0
            }
            _ => 0,
        };
        // Keeps the listed order of the rest: ties go to the first listed.
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

fn forward(start: usize, end: usize) -> Piece {
    Piece { start, end, reversed: false }
}

/// State before a step, and the step's value.
type Known<S> = (Option<S>, f64);

struct Annealing<'a, C: Chain> {
    chain: &'a C,
    candidates: &'a Candidates,
    objective: Objective,
    order: Vec<usize>,
    /// Position of each point of the chain; of no meaning for points that are not in the order.
    place: Vec<usize>,
    /// What is known of each position's step; no state at 0, and behind the last position what its step leaves and the
    /// value of the way back to the first point.
    known: Vec<Known<C::State>>,
    /// The order that is proposed from the first piece's place on; what follows the pieces stays as it is.
    pieces: Vec<Piece>,
    begin: usize,
    /// New positions whose step changes.
    log: Vec<(usize, Known<C::State>)>,
    scratch: Vec<(usize, Known<C::State>)>,
}

impl<'a, C: Chain> Annealing<'a, C> {
    fn new(chain: &'a C, candidates: &'a Candidates, order: &[usize], objective: Objective) -> Self {
        let mut annealing = Annealing {
            chain,
            candidates,
            objective,
            order: order.to_vec(),
            place: vec![0; chain.len()],
            known: vec![(None, 0.0); order.len() + 1],
            pieces: Vec::new(),
            begin: 0,
            log: Vec::new(),
            scratch: Vec::new(),
        };
        for (position, point) in order.iter().enumerate() {
            annealing.place[*point] = position;
        }
        annealing.refresh();
        annealing
    }

    /// Works out all states and values again.
    fn refresh(&mut self) {
        let mut state = None;
        for k in 0..self.order.len() {
            let (value, next) = self.at(k.checked_sub(1).map(|p| self.order[p]), self.order[k], state);
            self.known[k] = (state, value);
            state = Some(next);
        }
        let ends = self.order.first().copied().zip(self.order.last().copied());
        self.known[self.order.len()] = (state, self.way_back(ends, state));
    }

    /// Value of the jump from the last point back to the first, if there is one.
    #[inline]
    fn way_back(&self, ends: Option<(usize, usize)>, state: Option<C::State>) -> f64 {
        match (ends, state) {
            (Some((first, last)), Some(state)) if self.chain.returns() && first != last => {
                self.at(Some(last), first, Some(state)).0
            }
            _ => 0.0,
        }
    }

    #[inline]
    fn at(&self, from: Option<usize>, to: usize, state: Option<C::State>) -> (f64, C::State) {
        match (from, state) {
            (Some(from), Some(state)) => {
                let (gradient_k, next) = self.chain.step(from, to, state);
                (self.objective.value(self.chain, from, to, gradient_k), next)
            }
            _ => (0.0, self.chain.first(to)),
        }
    }

    /// What the proposed pieces would gain; leaves the new states and values in the log.
    fn gain(&mut self) -> f64 {
        self.log.clear();
        let n = self.order.len();
        if self.pieces.is_empty() {
            return 0.0;
        }
        let mut gain = 0.0;
        let mut state = self.known[self.begin].0;
        let mut from = self.begin.checked_sub(1).map(|p| self.order[p]);
        let mut position = self.begin;
        let rest = self.pieces.iter().map(|piece| piece.end).max().unwrap_or(n);
        for which in 0..=self.pieces.len() {
            let piece = self.pieces.get(which).copied().unwrap_or_else(|| forward(rest, n));
            let mut done = 0;
            while done < piece.end - piece.start {
                let k = if piece.reversed { piece.end - 1 - done } else { piece.start + done };
                let (old_state, old_value) = self.known[k];
                if !piece.reversed
                    && let (Some(new), Some(old), Some(p)) = (state, old_state, k.checked_sub(1))
                    && from == Some(self.order[p])
                    && self.chain.alike(new, old)
                {
                    // The housing has forgotten: the rest of the piece goes as before.
                    position += piece.end - k;
                    state = self.known[piece.end].0;
                    from = Some(self.order[piece.end - 1]);
                    break;
                }
                let to = self.order[k];
                let (value, next) = self.at(from, to, state);
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
        let back = self.way_back(from.map(|last| (first, last)), state);
        gain += back - self.known[n].1;
        self.log.push((n, (state, back)));
        gain
    }

    fn accept(&mut self) {
        // What stays in its place is not moved; the far ends of a swap lie far apart.
        self.scratch.clear();
        let mut position = self.begin;
        for piece in &self.pieces {
            let length = piece.end - piece.start;
            if piece.reversed || piece.start != position {
                for done in 0..length {
                    let k = if piece.reversed { piece.end - 1 - done } else { piece.start + done };
                    self.scratch.push((self.order[k], self.known[k]));
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
                    (self.order[k], self.known[k], self.place[point]) = (point, known, k);
                    next += 1;
                }
            }
            position += length;
        }
        for &(k, known) in &self.log {
            self.known[k] = known;
        }
    }

    fn set(&mut self, begin: usize, pieces: &[Piece]) {
        self.begin = begin;
        self.pieces.clear();
        self.pieces.extend(pieces.iter().filter(|piece| piece.start < piece.end));
    }

    fn swap(&mut self, a: usize, b: usize) {
        let (low, high) = (a.min(b), a.max(b));
        if low < high {
            let ends = [forward(high, high + 1), forward(low + 1, high), forward(low, low + 1)];
            self.set(low, &ends);
        }
    }

    /// Puts the stretch `start..end` before position `to`, which lies outside of it.
    fn shift(&mut self, start: usize, end: usize, to: usize, reversed: bool) {
        let stretch = Piece { start, end, reversed };
        if to < start {
            self.set(to, &[stretch, forward(to, start)]);
        } else if to > end {
            self.set(start, &[forward(end, to), stretch]);
        } else if reversed {
            self.set(start, &[stretch]);
        }
    }

    /// Prepares a move; nothing where what was drawn changes nothing.
    fn propose(&mut self, random: &mut Pcg64Mcg) {
        self.pieces.clear();
        let n = self.order.len();
        let i = random.random_range(0..n);
        let kind: u32 = random.random_range(0..20);
        if kind < 10 && self.guided(i, kind, random) {
            return;
        }
        match kind % 10 {
            0..4 => {
                let j = random.random_range(0..n);
                self.swap(i, j);
            }
            4..6 => {
                let end = (i + 2 + random.random_range(0..LONGEST_STRETCH)).min(n);
                self.set(i, &[Piece { start: i, end, reversed: true }]);
            }
            _ => {
                let end = (i + random.random_range(1..=3usize)).min(n);
                let reach = LONGEST_STRETCH.min(n);
                let to = if random.random::<bool>() {
                    random.random_range(0..=n)
                } else {
                    (i + random.random_range(0..=2 * reach)).saturating_sub(reach).min(n)
                };
                if !(i..=end).contains(&to) {
                    self.shift(i, end, to, kind.is_multiple_of(4));
                }
            }
        }
    }

    /// A move after which the point at `i` is followed by one of its candidates.
    fn guided(&mut self, i: usize, kind: u32, random: &mut Pcg64Mcg) -> bool {
        let n = self.order.len();
        let Some(to) = self.candidates.draw(self.order[i], random) else { return false };
        let q = self.place[to];
        if q == i + 1 || q == i {
            return false;
        }
        // Mostly a few points, at times a long stretch: three cuts, no step reversed.
        let length = match random.random_range(0..4u32) {
            0 => random.random_range(1..=n),
            _ => random.random_range(1..=3usize),
        };
        match kind % 3 {
            0 if i + 1 < n => self.swap(i + 1, q),
            // The stretch that begins with the candidate comes behind.
            1 => {
                let end = (q + length).min(if q < i { i } else { n });
                self.shift(q, end, i + 1, false);
            }
            // The stretch that ends with this point goes before the candidate.
            _ => {
                let start = (i + 1).saturating_sub(length).max(if q < i { q + 1 } else { 0 });
                self.shift(start, i + 1, q, false);
            }
        }
        !self.pieces.is_empty()
    }

    fn run(&mut self, moves: u64, random: &mut Pcg64Mcg, best: &mut Vec<usize>, best_figure: &mut f64) {
        // Typical change of value, from moves that are not made.
        let sizes: Vec<f64> = (0..200)
            .map(|_| {
                self.propose(random);
                self.gain().abs()
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
                let gain = self.gain();
                if gain >= 0.0 || gain > temperature * random.random::<f64>().ln() {
                    self.accept();
                }
            }
            // Small differences that "alike" let pass do not add up beyond a stage.
            self.refresh();
            let figure = self.objective.figure(self.chain, &self.order);
            if figure > *best_figure {
                *best_figure = figure;
                best.clone_from(&self.order);
            }
        }
    }
}
