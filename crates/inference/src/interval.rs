//! The shortest interval of a mixture of normal distributions about weighted centres.

use mapper_numerics::statistics::{EXCLUDE_SIGMAS, range};

/// Cells of the density for one standard deviation. Bound: the error of the interval is then below 0.01 standard deviations.
const CELLS_PER_SIGMA: f64 = 16.0;
/// Maximum number of cells between the lowest and the highest centre. Bound: the effort if the centres are far apart.
const MAX_CELLS: f64 = 4096.0;

/// Coverage of all reported intervals. Source: the usual coverage of measurement uncertainty (GUM, JCGM 100, 6.3).
pub const COVERAGE: f64 = 0.95;

/// Whether data carry more information about a parameter than its prior, from the widths (or errors) after and before them; otherwise the prior
/// dominates. Precisions add up, so the width falls to less than the root of a half.
pub fn is_identified(after: f64, before: f64) -> bool {
    2.0 * after * after < before * before
}

/// Shortest interval that contains `coverage` of the mixture of normal distributions about `centres` (weight, value), each with the
/// standard deviation `sigma`. `None` if there are no centres or a number is not finite.
pub fn shortest(centres: &[(f64, f64)], sigma: f64, coverage: f64) -> Option<(f64, f64)> {
    let (low, high) = range(centres.iter().map(|(_, x)| *x));
    if !(low.is_finite() && high.is_finite() && sigma.is_finite()) {
        return None;
    }
    let width = (sigma / CELLS_PER_SIGMA).max((high - low) / MAX_CELLS);
    if width <= 0.0 {
        return Some((low, low));
    }
    let reach = (EXCLUDE_SIGMAS * sigma / width).ceil() as usize;
    let cells = ((high - low) / width).ceil() as usize + 2 + 2 * reach;
    let mut weights = vec![0.0; cells];
    for (weight, x) in centres {
        // Shared between the cells on either side, so that the mean stays.
        let at = (x - low) / width;
        let cell = at.floor();
        let share = at - cell;
        let cell = reach + cell as usize;
        weights[cell] += weight * (1.0 - share);
        weights[cell + 1] += weight * share;
    }
    let kernel: Vec<f64> = (0..=reach)
        .map(|k| if sigma > 0.0 { (-0.5 * (k as f64 * width / sigma).powi(2)).exp() } else { 1.0 })
        .collect();
    let mut density = vec![0.0; cells];
    for (cell, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        for (k, value) in kernel.iter().enumerate() {
            density[cell.saturating_sub(k)] += weight * value;
            if k > 0 {
                density[(cell + k).min(cells - 1)] += weight * value;
            }
        }
    }
    let total: f64 = density.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    // Share below the upper edge of each cell.
    let mut below = Vec::with_capacity(cells + 1);
    let mut sum = 0.0;
    below.push(0.0);
    for value in &density {
        sum += value / total;
        below.push(sum);
    }
    let edge = |position: f64| low + (position - reach as f64 - 0.5) * width;
    let quantile = |share: f64| {
        let upper = below.partition_point(|below| *below < share).clamp(1, cells);
        let (before, after) = (below[upper - 1], below[upper]);
        let within = if after > before { ((share - before) / (after - before)).clamp(0.0, 1.0) } else { 0.0 };
        edge((upper - 1) as f64 + within)
    };
    let beyond = 1.0 - coverage;
    (0..cells)
        .map(|cell| below[cell])
        .take_while(|share| *share <= beyond)
        .chain([0.5 * beyond])
        .map(|share| (quantile(share), quantile(share + coverage)))
        .min_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One normal distribution: 1.96 standard deviations on either side of its mean.
    #[test]
    fn one_centre_gives_the_normal_interval() {
        for (centre, sigma) in [(0.0, 1.0), (0.64, 2e-3), (-300.0, 40.0)] {
            let (low, high) = shortest(&[(1.0, centre)], sigma, 0.95).unwrap();
            for (bound, expected) in [(low, centre - 1.959964 * sigma), (high, centre + 1.959964 * sigma)] {
                // The interval of a symmetric density is flat in its place: a hundredth of a standard deviation is not seen.
                assert!((bound - expected).abs() < 0.03 * sigma, "{centre} {sigma}: {bound} {expected}");
            }
        }
    }

    /// A mixture of two by counting its draws (equal ranks of each part).
    #[test]
    fn a_mixture_is_what_its_draws_say() {
        use mapper_numerics::statistics::normal_quantile;
        let (centres, sigma) = ([(0.7, 0.0), (0.3, 3.0)], 0.5);
        let ranks = 20_000;
        let mut draws: Vec<(f64, f64)> = Vec::new();
        for (weight, centre) in centres {
            for rank in 0..ranks {
                let share = (f64::from(rank) + 0.5) / f64::from(ranks);
                draws.push((centre + sigma * normal_quantile(share).unwrap(), weight / f64::from(ranks)));
            }
        }
        draws.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (low, high) = shortest(&centres, sigma, 0.95).unwrap();
        let inside: f64 =
            draws.iter().filter(|(x, _)| (low..=high).contains(x)).map(|(_, weight)| weight).sum();
        assert!((inside - 0.95).abs() < 2e-3, "{inside}");
        let mut best = f64::INFINITY;
        let (mut end, mut sum) = (0, 0.0);
        for start in 0..draws.len() {
            while end < draws.len() && sum < 0.95 {
                sum += draws[end].1;
                end += 1;
            }
            if sum < 0.95 {
                break;
            }
            best = best.min(draws[end - 1].0 - draws[start].0);
            sum -= draws[start].1;
        }
        assert!((high - low - best).abs() < 0.02 * sigma, "{} {best}", high - low);
    }

    #[test]
    fn without_noise_and_without_centres() {
        assert_eq!(shortest(&[(1.0, 0.5)], 0.0, 0.95), Some((0.5, 0.5)));
        assert_eq!(shortest(&[], 1.0, 0.95), None);
        assert_eq!(shortest(&[(1.0, f64::NAN)], 1.0, 0.95), None);
    }
}
