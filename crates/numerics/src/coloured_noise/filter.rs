//! Whitens residuals with white plus first-order noise: the results are independent and have unit variance.
//!
//! The innovations of a Kalman filter whose state is the first-order part: the same linear recursion applies to a residual and to each of
//! its derivatives, and gaps in time need no special treatment. Source: B. D. O. Anderson, J. B. Moore, Optimal Filtering (1979), chapter
//! 5.

use super::ColouredNoise;
use super::first_order;
use super::first_order::CONSTANT_BELOW;

/// Minimum share of white noise in the variance of a sample. Bound: never zero, since a filter that trusts each row completely is useless.
const MIN_WHITE_OF_SAMPLE_RATIO: f64 = 1e-3;
/// Minimum share of white noise in the variance of a mean. Bound: as for a sample; a mean over a short block has more.
const MIN_WHITE_RATIO: f64 = 0.02;

/// Kalman filter that whitens columns row by row.
#[derive(Debug, Clone, Default)]
pub struct WhiteningFilter {
    /// For each row: decay since the previous row, and, if the row is used, Kalman gain and the reciprocal of the innovation's standard deviation.
    gains: Vec<(f64, Option<[f64; 2]>)>,
    /// Sum of the logarithms of the innovations' standard deviations, relative to that of a single sample.
    pub ln_spreads: f64,
}

/// Variances of a row's noise, relative to the variance of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockNoise {
    /// Part that is independent from row to row.
    pub white: f64,
    /// First-order part.
    pub first_order: f64,
}

impl BlockNoise {
    /// Noise of the mean of `samples` readings over `block_s`; each reading has variance 1.
    ///
    /// The first-order part has the covariance [`first_order::block_covariance`] between blocks.
    /// The white part is reduced so that the total variance of the mean is correct.
    pub fn of_mean(noise: ColouredNoise, samples: f64, block_s: f64) -> Self {
        let share = noise.first_order_variance_ratio();
        let white = noise.white_variance_ratio() / samples.max(1.0);
        if block_s / noise.time_constant_s < CONSTANT_BELOW || samples < 2.0 {
            return BlockNoise { white: white.max(MIN_WHITE_OF_SAMPLE_RATIO), first_order: share };
        }
        let first_order = first_order::block_covariance(share, block_s, noise.time_constant_s);
        let own = first_order::variance_of_mean(share, block_s, noise.time_constant_s);
        BlockNoise { white: (white + own - first_order).max(MIN_WHITE_RATIO * (white + own)), first_order }
    }
}

impl WhiteningFilter {
    /// A filter for rows at rising times, each with its noise and whether it is used. A single sample has the standard deviation `sigma`;
    /// the white part of the rows is that of samples with `white_sigma`.
    pub fn new(
        rows: impl Iterator<Item = (f64, BlockNoise, bool)>,
        time_constant_s: f64,
        sigma: f64,
        white_sigma: f64,
    ) -> Self {
        let white_ratio = (white_sigma / sigma).powi(2);
        let mut last_s = f64::NEG_INFINITY;
        let mut spread = 0.0;
        let mut ln_spreads = 0.0;
        let gains = rows
            .map(|(t_s, noise, is_used)| {
                let memory = ((last_s - t_s) / time_constant_s).exp();
                last_s = t_s;
                spread = memory * memory * spread + (1.0 - memory * memory) * noise.first_order;
                let used = is_used.then(|| {
                    let innovation = spread + noise.white * white_ratio;
                    let gain = spread / innovation;
                    spread *= 1.0 - gain;
                    ln_spreads += 0.5 * innovation.ln();
                    [gain, 1.0 / (sigma * innovation.sqrt())]
                });
                (memory, used)
            })
            .collect();
        WhiteningFilter { gains, ln_spreads }
    }

    /// Whitens a column with one value for each row, in place; rows that are not used become 0.
    pub fn apply(&self, column: &mut [f64]) {
        let mut state = 0.0;
        for (value, (memory, used)) in column.iter_mut().zip(&self.gains) {
            state *= memory;
            *value = used.map_or(0.0, |[gain, scale]| {
                let innovation = *value - state;
                state += gain * innovation;
                innovation * scale
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Whitening is a linear map W: with C the covariance of the rows, W C W' must be the identity.
    #[test]
    fn whitened_noise_has_unit_covariance() {
        let t_s = [0.0, 0.5, 1.0, 1.5, 4.0, 4.5];
        let noise = BlockNoise { white: 0.3, first_order: 0.5 };
        let (sigma, white_sigma) = (0.7, 0.35);
        let filter = WhiteningFilter::new(t_s.iter().map(|t| (*t, noise, true)), 2.0, sigma, white_sigma);
        let covariance = DMatrix::from_fn(6, 6, |i, j| {
            let white = if i == j { noise.white * white_sigma * white_sigma } else { 0.0 };
            white + sigma * sigma * noise.first_order * first_order::memory(t_s[i] - t_s[j], 2.0)
        });
        let mut whitened = covariance;
        for _ in 0..2 {
            for mut column in whitened.column_iter_mut() {
                filter.apply(column.as_mut_slice());
            }
            whitened.transpose_mut();
        }
        assert!((whitened - DMatrix::identity(6, 6)).abs().max() < 1e-12);
    }

    /// Compared with the dense covariance `smooth^2 exp(-|dt|/alike) + white^2`: the same quadratic form and determinant.
    #[test]
    fn used_rows_have_the_dense_covariance() {
        let t_s = [0.0, 0.1, 0.35, 0.4, 2.0, 2.1, 7.0];
        let counts = [true, true, false, true, true, false, true];
        let (white, smooth, alike_s) = (0.2, 0.7, 1.5);
        let column = [0.3, -0.2, 9.0, 0.5, 1.1, 9.0, -0.4];
        let seen: Vec<usize> = (0..t_s.len()).filter(|i| counts[*i]).collect();
        let covariance = DMatrix::from_fn(seen.len(), seen.len(), |i, j| {
            let apart: f64 = t_s[seen[i]] - t_s[seen[j]];
            smooth * smooth * (-apart.abs() / alike_s).exp() + if i == j { white * white } else { 0.0 }
        });
        let values = DMatrix::from_fn(seen.len(), 1, |i, _| column[seen[i]]);
        let inverse = covariance.clone().try_inverse().unwrap();
        let expected = (values.transpose() * inverse * &values)[(0, 0)];
        let noise = BlockNoise { white: white * white, first_order: smooth * smooth };
        let rows = t_s.iter().zip(counts).map(|(t_s, counts)| (*t_s, noise, counts));
        let filter = WhiteningFilter::new(rows, alike_s, 1.0, 1.0);
        let mut white_column = column;
        filter.apply(&mut white_column);
        let squares: f64 = white_column.iter().map(|w| w * w).sum();
        assert!((squares / expected - 1.0).abs() < 1e-12, "{squares} {expected}");
        assert!((filter.ln_spreads - 0.5 * covariance.determinant().ln()).abs() < 1e-12);
    }

    #[test]
    fn a_row_has_the_variance_of_its_mean() {
        let noise = ColouredNoise::new(0.6, 2.0);
        let row = BlockNoise::of_mean(noise, 5.0, 0.5);
        assert!((row.white + row.first_order - noise.variance_of_mean(5, 0.5)).abs() < 1e-15);
        // A single sample has all of it.
        let single = BlockNoise::of_mean(noise, 1.0, 0.5);
        assert!((single.white + single.first_order - 1.0).abs() < 1e-15);
    }
}
