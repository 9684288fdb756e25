//! The promising successors of each point: those that the assignment of successors with the largest sum of gradients favours.

use crate::housing::{Chain, value_k};
use mapper_numerics::statistics::nearest_rank;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

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

/// Prices of the columns.
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
