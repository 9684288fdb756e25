//! A nearly optimal assignment with prices, for many rows: the auction algorithm with decreasing increments (Bertsekas, Annals of
//! Operations Research 14:105, 1988).
//!
//! Many rows have nearly equal weights, and then the exact method searches almost the whole table for each row. Here the prices are
//! inexact by one increment. This loosens the bound by one increment per row, and saves most of the time.

/// Ratio of each increment to the one before.
const INCREMENT_RATIO: f64 = 0.2;
/// Maximum number of bids for each row in a round, so that an auction ends for any weights.
const MAX_BIDS_PER_ROW: usize = 60;

/// Prices of the columns, and the resulting upper bound.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Prices {
    /// No complete assignment has a larger total weight.
    pub(crate) bound: f64,
    /// Largest profit of each row at these prices: `max_j weight(i, j) - price(j)`.
    pub(crate) profit: Vec<f64>,
    pub(crate) price: Vec<f64>,
}

/// Finds prices for the assignment with the largest total of `weight`, a table of `n` rows and `n` columns.
///
/// `increments`: the first and the last. The bound is valid for any; it exceeds the largest total by about `n` times the last.
pub(crate) fn run_auction(n: usize, weight: &[f64], increments: (f64, f64)) -> Prices {
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
    Prices { bound: profit.iter().sum::<f64>() + price.iter().sum::<f64>(), profit, price }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::upper_bound::assignment::solve_assignment;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_bound_is_above_the_best_by_no_more_than_increments(
            weights in prop::collection::vec(0.0..30.0f64, 400),
            n in 2usize..=20,
        ) {
            let weight: Vec<f64> = weights[..n * n].to_vec();
            let (best, _) = solve_assignment(n, |i, j| weight[n * i + j]);
            let found = run_auction(n, &weight, (10.0, 0.01));
            // Each row is content within one increment when all are assigned.
            prop_assert!(found.bound >= best - 1e-9 && found.bound <= best + 0.01 * n as f64 + 1e-9, "{} {best}", found.bound);
        }
    }
}
