//! Whitens residuals with white plus first-order noise: the results are independent and have unit variance.
//!
//! The innovations of a Kalman filter whose state is the first-order part: the same linear recursion applies to a residual and to each of
//! its derivatives, and gaps in time need no special treatment. Source: B. D. O. Anderson, J. B. Moore, Optimal Filtering (1979), chapter
//! 5.

use super::ColouredNoise;
use super::first_order;

/// Kalman filter that whitens columns row by row.
#[derive(Debug, Clone, Default)]
pub struct WhiteningFilter {
    /// For each row: decay since the previous row, Kalman gain, and the reciprocal of the innovation's standard deviation.
    gains: Vec<[f64; 3]>,
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
        if block_s / noise.time_constant_s < 1e-4 || samples < 2.0 {
            return BlockNoise { white: white.max(1e-3), first_order: share };
        }
        let first_order = first_order::block_covariance(share, block_s, noise.time_constant_s);
        let own = first_order::variance_of_mean(share, block_s, noise.time_constant_s);
        // Never zero: a filter that trusts each row completely is useless.
        BlockNoise { white: (white + own - first_order).max(0.02 * (white + own)), first_order }
    }
}

impl WhiteningFilter {
    /// A filter for rows at rising times. A single sample has the standard deviation `sigma`; the white part of the rows is that of
    /// samples with `white_sigma`.
    pub fn new(
        rows: impl Iterator<Item = (f64, BlockNoise)>,
        time_constant_s: f64,
        sigma: f64,
        white_sigma: f64,
    ) -> Self {
        let white_ratio = (white_sigma / sigma).powi(2);
        let mut last_s = f64::NEG_INFINITY;
        let mut spread = 0.0;
        let gains = rows
            .map(|(t_s, noise)| {
                let memory = ((last_s - t_s) / time_constant_s).exp();
                let first_order = noise.first_order;
                spread = memory * memory * spread + (1.0 - memory * memory) * first_order;
                let innovation = spread + noise.white * white_ratio;
                let gain = spread / innovation;
                spread *= 1.0 - gain;
                last_s = t_s;
                [memory, gain, 1.0 / (sigma * innovation.sqrt())]
            })
            .collect();
        WhiteningFilter { gains }
    }

    /// Whitens a column with one value for each row, in place.
    pub fn apply(&self, column: &mut [f64]) {
        let mut state = 0.0;
        for (value, [memory, gain, scale]) in column.iter_mut().zip(&self.gains) {
            state *= memory;
            let innovation = *value - state;
            state += gain * innovation;
            *value = innovation * scale;
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
        let filter = WhiteningFilter::new(t_s.iter().map(|t| (*t, noise)), 2.0, sigma, white_sigma);
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
