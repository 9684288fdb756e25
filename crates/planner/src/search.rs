//! Search for a good order under thermal memory: annealing with restarts, seeded, bounded by its number of moves.
//!
//! A move swaps two points, reverses a stretch, or shifts one to three points. It is judged by going through the steps
//! it touches and on until the housing no longer remembers: a few steps, however long the order is.

use crate::chain::Chain;
use crate::objective::Objective;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Longest stretch that is reversed or shifted over: longer ones cost as much as they rarely gain.
const LONGEST_STRETCH: usize = 50;

/// How much work a search does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Moves tried in each start.
    pub moves: u64,
    /// Starts.
    pub starts: u32,
}

impl Effort {
    /// The same with half the moves, for a search in two rounds.
    pub fn halved(self) -> Self {
        Effort { moves: self.moves / 2, ..self }
    }

    /// Tuned so that 18 points take a fraction of a second, 200 some seconds, 2000 well below a minute; `factor` scales
    /// it.
    pub fn usual(points: usize, factor: f64) -> Self {
        let (moves, starts) = match points {
            // Few points: many short starts find more than few long ones.
            0..=40 => (60_000.0, 16),
            41..=500 => (20_000.0 * points as f64, 2),
            _ => (10_000.0 * points as f64, 1),
        };
        Effort { moves: (moves * factor.clamp(0.0, 1e4)) as u64, starts }
    }
}

/// The best order found from `given`, which lists each point once.
pub fn search<C: Chain>(
    chain: &C,
    given: &[usize],
    objective: Objective,
    effort: Effort,
    seed: u64,
) -> Vec<usize> {
    let mut best = given.to_vec();
    if given.len() < 2 {
        return best;
    }
    let mut best_figure = objective.figure(chain, &best);
    let greedy = greedy(chain, given, objective);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    for start in 0..effort.starts.max(1) {
        let mut annealing = Annealing::new(chain, if start == 0 { &greedy } else { &best }, objective);
        annealing.run(effort.moves, start % 2 == 1, &mut random, &mut best, &mut best_figure);
    }
    best
}

/// Each time the point whose step is worth most.
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
            _ => chain.first(to).1,
        });
        order.push(to);
    }
    order
}

/// Positions `start..start + points.len()` of an order get other points.
#[derive(Debug, Clone, Copy)]
struct Change {
    start: usize,
    end: usize,
    /// Where its points begin in the scratch.
    scratch: usize,
}

struct Annealing<'a, C: Chain> {
    chain: &'a C,
    objective: Objective,
    order: Vec<usize>,
    /// State before each position's step; at 0 unused.
    before: Vec<Option<C::State>>,
    value: Vec<f64>,
    scratch: Vec<usize>,
    changes: Vec<Change>,
    log: Vec<(usize, Option<C::State>, f64)>,
}

impl<'a, C: Chain> Annealing<'a, C> {
    fn new(chain: &'a C, order: &[usize], objective: Objective) -> Self {
        let mut annealing = Annealing {
            chain,
            objective,
            order: order.to_vec(),
            before: vec![None; order.len()],
            value: vec![0.0; order.len()],
            scratch: Vec::new(),
            changes: Vec::new(),
            log: Vec::new(),
        };
        annealing.refresh();
        annealing
    }

    /// Works out all states and values anew.
    fn refresh(&mut self) {
        let mut state = None;
        for k in 0..self.order.len() {
            let (value, next) = self.at(k.checked_sub(1).map(|p| self.order[p]), self.order[k], state);
            (self.before[k], self.value[k]) = (state, value);
            state = Some(next);
        }
    }

    #[inline]
    fn at(&self, from: Option<usize>, to: usize, state: Option<C::State>) -> (f64, C::State) {
        match (from, state) {
            (Some(from), Some(state)) => {
                let (gradient_k, next) = self.chain.step(from, to, state);
                (self.objective.value(self.chain, from, to, gradient_k), next)
            }
            _ => {
                let (gradient_k, next) = self.chain.first(to);
                (self.objective.first_value(self.chain, to, gradient_k), next)
            }
        }
    }

    /// What the prepared changes would gain; leaves the new states and values in the log.
    fn gain(&mut self) -> f64 {
        self.log.clear();
        let n = self.order.len();
        let Some(first) = self.changes.first().copied() else { return 0.0 };
        let (mut k, mut which, mut gain) = (first.start, 0, 0.0);
        let mut state = self.before[k];
        let mut from = k.checked_sub(1).map(|p| self.order[p]);
        while k < n {
            while which < self.changes.len() && k >= self.changes[which].end {
                which += 1;
            }
            let change = self.changes.get(which).filter(|change| k >= change.start);
            if change.is_none()
                && from == k.checked_sub(1).map(|p| self.order[p])
                && let (Some(new), Some(old)) = (state, self.before[k])
                && self.chain.alike(new, old)
            {
                // The housing has forgotten; on to the next change.
                let Some(next) = self.changes.get(which) else { break };
                k = next.start;
                state = self.before[k];
                from = k.checked_sub(1).map(|p| self.order[p]);
                continue;
            }
            let to = change.map_or(self.order[k], |change| self.scratch[change.scratch + k - change.start]);
            let (value, next) = self.at(from, to, state);
            gain += value - self.value[k];
            self.log.push((k, state, value));
            (state, from) = (Some(next), Some(to));
            k += 1;
        }
        gain
    }

    fn accept(&mut self) {
        for change in &self.changes {
            let points = &self.scratch[change.scratch..change.scratch + change.end - change.start];
            self.order[change.start..change.end].copy_from_slice(points);
        }
        for &(k, state, value) in &self.log {
            (self.before[k], self.value[k]) = (state, value);
        }
    }

    /// Prepares a random move.
    fn propose(&mut self, random: &mut Pcg64Mcg) {
        self.scratch.clear();
        self.changes.clear();
        let n = self.order.len();
        let i = random.random_range(0..n);
        let kind: u32 = random.random_range(0..10);
        if kind < 4 {
            let mut j = random.random_range(0..n - 1);
            j += usize::from(j >= i);
            let (low, high) = (i.min(j), i.max(j));
            self.scratch.extend([self.order[high], self.order[low]]);
            self.changes.push(Change { start: low, end: low + 1, scratch: 0 });
            self.changes.push(Change { start: high, end: high + 1, scratch: 1 });
            return;
        }
        let reach = LONGEST_STRETCH.min(n - 1);
        let j = (i + random.random_range(1..=reach)) % n;
        let (low, high) = (i.min(j), i.max(j));
        let high = high.min(low + LONGEST_STRETCH);
        self.scratch.extend_from_slice(&self.order[low..=high]);
        let length = high - low + 1;
        if kind < 6 {
            self.scratch.reverse();
        } else {
            let shifted = random.random_range(1..=3usize).min(length - 1);
            if random.random::<bool>() {
                self.scratch.rotate_left(shifted);
                if kind == 9 {
                    self.scratch[length - shifted..].reverse();
                }
            } else {
                self.scratch.rotate_right(shifted);
                if kind == 9 {
                    self.scratch[..shifted].reverse();
                }
            }
        }
        self.changes.push(Change { start: low, end: high + 1, scratch: 0 });
    }

    fn run(
        &mut self,
        moves: u64,
        gently: bool,
        random: &mut Pcg64Mcg,
        best: &mut Vec<usize>,
        best_figure: &mut f64,
    ) {
        // Typical change of value, from moves that are not made.
        let mut sizes: Vec<f64> = (0..200)
            .map(|_| {
                self.propose(random);
                self.gain().abs()
            })
            .filter(|size| *size > 0.0 && *size < 1e5)
            .collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes.get(sizes.len() / 2).copied().unwrap_or(1.0);
        let (hottest, coldest) = (typical * if gently { 0.1 } else { 0.5 }, typical * 5e-4);
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
