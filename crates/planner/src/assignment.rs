//! Assignment of successors: the largest sum of pair values, by an auction.

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

/// Finds the complete assignment of rows to columns with the largest total weight: the total, and the column of each row.
/// `weight(row, column)` has to be finite.
pub(crate) fn solve_assignment(n: usize, weight: impl Fn(usize, usize) -> f64) -> (f64, Vec<usize>) {
    // Potentials of rows and columns, and the row of each column; index 0 stands for none.
    let (mut u, mut v) = (vec![0.0; n + 1], vec![0.0; n + 1]);
    let (mut row_of, mut previous_column) = (vec![0usize; n + 1], vec![0usize; n + 1]);
    for row in 1..=n {
        row_of[0] = row;
        let mut column = 0;
        let mut min_reduced = vec![f64::INFINITY; n + 1];
        let mut used = vec![false; n + 1];
        loop {
            used[column] = true;
            let (current, mut delta, mut next) = (row_of[column], f64::INFINITY, 0);
            for j in 1..=n {
                if used[j] {
                    continue;
                }
                let reduced = -weight(current - 1, j - 1) - u[current] - v[j];
                if reduced < min_reduced[j] {
                    (min_reduced[j], previous_column[j]) = (reduced, column);
                }
                if min_reduced[j] < delta {
                    (delta, next) = (min_reduced[j], j);
                }
            }
            for j in 0..=n {
                if used[j] {
                    u[row_of[j]] += delta;
                    v[j] -= delta;
                } else {
                    min_reduced[j] -= delta;
                }
            }
            column = next;
            if row_of[column] == 0 {
                break;
            }
        }
        while column != 0 {
            let before = previous_column[column];
            row_of[column] = row_of[before];
            column = before;
        }
    }
    let mut column_of = vec![0; n];
    (1..=n).for_each(|j| column_of[row_of[j] - 1] = j - 1);
    (column_of.iter().enumerate().map(|(row, column)| weight(row, *column)).sum(), column_of)
}

/// Finds the largest threshold at which all rows except `max_unmatched` can be matched to different columns with at least that weight.
pub(crate) fn solve_bottleneck(
    rows: usize,
    columns: usize,
    max_unmatched: usize,
    weight: impl Fn(usize, usize) -> f64,
) -> f64 {
    let places = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    let mut thresholds: Vec<f64> = places.map(|(i, j)| weight(i, j)).collect();
    thresholds.retain(|w| w.is_finite());
    thresholds.sort_by(f64::total_cmp);
    thresholds.dedup();
    let can_match = |threshold: f64| {
        let mut row_of = vec![None; columns];
        let unmatched = (0..rows)
            .filter(|&row| {
                let mut visited = vec![false; columns];
                !augment(row, &|i, j| weight(i, j) >= threshold, &mut visited, &mut row_of)
            })
            .take(max_unmatched + 1)
            .count();
        unmatched <= max_unmatched
    };
    let possible = thresholds.partition_point(|threshold| can_match(*threshold));
    thresholds.get(possible.saturating_sub(1)).copied().unwrap_or(f64::INFINITY)
}

/// Searches an augmenting path from `row`, so that one more row is matched.
fn augment(
    row: usize,
    edge: &impl Fn(usize, usize) -> bool,
    visited: &mut [bool],
    row_of: &mut [Option<usize>],
) -> bool {
    for column in 0..visited.len() {
        if visited[column] || !edge(row, column) {
            continue;
        }
        visited[column] = true;
        let free = match row_of[column] {
            None => true,
            Some(other) => augment(other, edge, visited, row_of),
        };
        if free {
            row_of[column] = Some(row);
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
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

    fn permutations(n: usize) -> Vec<Vec<usize>> {
        if n == 0 {
            return vec![Vec::new()];
        }
        permutations(n - 1)
            .into_iter()
            .flat_map(|shorter| {
                (0..n).map(move |place| {
                    let mut longer = shorter.clone();
                    longer.insert(place, n - 1);
                    longer
                })
            })
            .collect()
    }

    proptest! {
        #[test]
        fn agrees_with_all_permutations(weights in prop::collection::vec(-10.0..10.0f64, 36), n in 1usize..=6) {
            let weight = |i: usize, j: usize| weights[6 * i + j];
            let all = permutations(n);
            let total = |p: &Vec<usize>| p.iter().enumerate().map(|(i, j)| weight(i, *j)).sum::<f64>();
            let best = all.iter().map(total).fold(f64::NEG_INFINITY, f64::max);
            // Sums of at most six numbers below 10.
            prop_assert!((solve_assignment(n, weight).0 - best).abs() < 1e-12);
            // All rows, and all but the worst one.
            for max_unmatched in 0..n.min(2) {
                let smallest = |p: &Vec<usize>| {
                    let mut row: Vec<f64> = p.iter().enumerate().map(|(i, j)| weight(i, *j)).collect();
                    row.sort_by(f64::total_cmp);
                    row[max_unmatched]
                };
                let largest = all.iter().map(smallest).fold(f64::NEG_INFINITY, f64::max);
                prop_assert_eq!(solve_bottleneck(n, n, max_unmatched, weight), largest);
            }
        }
    }
}
