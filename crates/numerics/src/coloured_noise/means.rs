//! Means over blocks of samples: their covariance, and the factor that whitens them.

use super::ColouredNoise;
use super::first_order::memory;
use nalgebra::DMatrix;

/// Distance in time constants beyond which correlation is neglected. Bound: it is then below 6e-6.
const NEGLIGIBLE_CORRELATION_DISTANCE: f64 = 12.0;
/// Blocks with fewer samples are summed over all pairs of samples. Bound: effort; the results are equal.
const MIN_SAMPLES_FACTORED: usize = 4;

/// Covariance of means of noise with standard deviation 1; one row for each block.
///
/// `C_ij = (1 - c^2) delta_ij / n_i + c^2 mean_kl exp(-|t_k - t_l| / tau)`, k in block i, l in block j, with c the
/// first-order share. `blocks` has the times of each block's samples, s, rising over all blocks; no block is empty.
pub fn covariance_of_means(blocks: &[&[f64]], noise: ColouredNoise) -> DMatrix<f64> {
    let tau_s = noise.time_constant_s;
    let mean_s = |times: &[f64]| times.iter().sum::<f64>() / times.len() as f64;
    let means_s: Vec<f64> = blocks.iter().map(|times| mean_s(times)).collect();
    let n = blocks.len();
    let mut covariance = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let (times_i, times_j) = (blocks[i], blocks[j]);
            let apart_s = means_s[i] - means_s[j];
            let correlation = if apart_s > NEGLIGIBLE_CORRELATION_DISTANCE * tau_s && i != j {
                0.0
            } else if i == j || times_i.len().min(times_j.len()) < MIN_SAMPLES_FACTORED {
                let pairs = times_i.iter().flat_map(|a| times_j.iter().map(move |b| a - b));
                pairs.map(|apart_s| memory(apart_s, tau_s)).sum::<f64>()
                    / (times_i.len() * times_j.len()) as f64
            } else {
                // Blocks do not overlap: the exponential of the distance factors.
                let from = |block: usize, sign: f64| {
                    let times = blocks[block];
                    times.iter().map(|t| (sign * (t - means_s[block]) / tau_s).exp()).sum::<f64>()
                        / times.len() as f64
                };
                memory(apart_s, tau_s) * from(i, -1.0) * from(j, 1.0)
            };
            let mut value = noise.first_order_variance_ratio() * correlation;
            if i == j {
                value += noise.white_variance_ratio() / times_i.len() as f64;
            }
            covariance[(i, j)] = value;
            covariance[(j, i)] = value;
        }
    }
    covariance
}

/// Lower Cholesky factor of a covariance, to whiten many vectors.
#[derive(Debug, Clone)]
pub struct WhiteningFactor {
    lower: DMatrix<f64>,
}

impl WhiteningFactor {
    /// Factor of a covariance; `None` if it is not positive definite.
    pub fn new(covariance: DMatrix<f64>) -> Option<Self> {
        Some(WhiteningFactor { lower: covariance.cholesky()?.unpack() })
    }

    /// Factor for `n` independent values with standard deviation `sigma`.
    pub fn independent(n: usize, sigma: f64) -> Self {
        WhiteningFactor { lower: DMatrix::identity(n, n) * sigma }
    }

    /// Replaces `values` by `L^-1 values`, one value for each row of the covariance.
    pub fn whiten(&self, values: &mut [f64]) {
        let n = values.len();
        // Columns are contiguous: forward substitution by columns.
        for column in 0..n {
            let l = &self.lower.as_slice()[column * n..(column + 1) * n];
            let x = values[column] / l[column];
            values[column] = x;
            for row in column + 1..n {
                values[row] -= l[row] * x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(t_s: &[f64]) -> Vec<&[f64]> {
        [(0, 1), (1, 2), (2, 10), (10, 60), (60, 110), (110, 200)].iter().map(|&(a, b)| &t_s[a..b]).collect()
    }

    #[test]
    fn the_covariance_is_the_sum_over_all_pairs_of_samples() {
        let t_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let (blocks, noise) = (blocks(&t_s), ColouredNoise::new(0.6, 2.0));
        let found = covariance_of_means(&blocks, noise);
        for (i, a) in blocks.iter().enumerate() {
            for (j, b) in blocks.iter().enumerate() {
                let pairs = a.iter().flat_map(|k| b.iter().map(move |l| noise.correlation(k - l)));
                let direct = pairs.sum::<f64>() / (a.len() * b.len()) as f64;
                // Covariances beyond twelve time constants (6e-6) are left out.
                assert!((found[(i, j)] - direct).abs() < 1e-5 * direct.max(1.0), "{i} {j}");
            }
        }
    }

    #[test]
    fn whitening_undoes_the_covariance() {
        // L^-1 C L^-T is the identity: whiten the columns, then the rows.
        let t_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let covariance = covariance_of_means(&blocks(&t_s), ColouredNoise::new(0.6, 2.0));
        let factor = WhiteningFactor::new(covariance.clone()).unwrap();
        let mut whitened = covariance;
        for _ in 0..2 {
            for mut column in whitened.column_iter_mut() {
                factor.whiten(column.as_mut_slice());
            }
            whitened.transpose_mut();
        }
        assert!((whitened - DMatrix::identity(6, 6)).abs().max() < 1e-12);
        assert!(WhiteningFactor::new(DMatrix::zeros(2, 2)).is_none());
        let mut values = [3.0, -1.5];
        WhiteningFactor::independent(2, 0.5).whiten(&mut values);
        assert_eq!(values, [6.0, -3.0]);
    }
}
