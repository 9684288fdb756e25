//! Coloured noise: white noise plus a stationary first-order process with the autocorrelation `exp(-|t - s| / time constant)`
//! (Ornstein-Uhlenbeck; AR(1) if samples are evenly spaced).
//!
//! Contains the variance and covariance of means, the product with the correlation matrix, and two
//! ways to whiten residuals.
//!
//! Source: P. E. Kloeden, E. Platen, Numerical Solution of Stochastic Differential Equations (1992), section 4.4; M. B.
//! Priestley, Spectral Analysis and Time Series (1981), section 5.3, for the variance of means.

use nalgebra::DMatrix;

/// White noise plus a first-order process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColouredNoise {
    /// Standard deviation of the first-order part over that of the whole, 0 to 1.
    pub first_order_share_ratio: f64,
    /// Time constant of the first-order part, s, 0 or more.
    pub time_constant_s: f64,
}

impl ColouredNoise {
    /// Noise whose first-order part has `first_order_share_ratio` of the standard deviation; values outside 0 to 1 are clamped.
    pub fn new(first_order_share_ratio: f64, time_constant_s: f64) -> Self {
        ColouredNoise { first_order_share_ratio: first_order_share_ratio.clamp(0.0, 1.0), time_constant_s }
    }

    /// Variance of the first-order part over that of the whole.
    pub fn first_order_variance_ratio(self) -> f64 {
        self.first_order_share_ratio * self.first_order_share_ratio
    }

    /// Variance of the white part over that of the whole.
    pub fn white_variance_ratio(self) -> f64 {
        1.0 - self.first_order_variance_ratio()
    }

    /// Correlation of two samples at a distance of `distance_s`. The white parts of different samples are independent.
    pub fn correlation(self, distance_s: f64) -> f64 {
        if distance_s == 0.0 {
            return 1.0;
        }
        self.first_order_variance_ratio() * crate::coloured_noise::memory(distance_s, self.time_constant_s)
    }

    /// Variance of the mean of `samples` readings spread evenly over `length_s`, over the variance of one reading.
    ///
    /// The first-order part is averaged over the whole length, not over the instants of the samples. The relative error is one
    /// twelfth of the square of the sample interval in time constants.
    pub fn variance_of_mean(self, samples: usize, length_s: f64) -> f64 {
        let first_order = self.first_order_variance_ratio();
        self.white_variance_ratio() / samples.max(1) as f64
            + crate::coloured_noise::variance_of_mean(first_order, length_s, self.time_constant_s)
    }
}

/// Computes `R x` with `R_ij = exp(-|t_i - t_j| / time_constant_s)`, in one pass forwards and one backwards; in the unit of `x`. `t_s`
/// rises and is as long as `x`.
pub fn correlate(t_s: &[f64], x: &[f64], time_constant_s: f64) -> Vec<f64> {
    let decay = |i: usize| ((t_s[i - 1] - t_s[i]) / time_constant_s).exp();
    let mut sums = x.to_vec();
    let mut carried = 0.0;
    for i in 0..x.len() {
        if i > 0 {
            carried = (carried + x[i - 1]) * decay(i);
        }
        sums[i] += carried;
    }
    carried = 0.0;
    for i in (0..x.len()).rev() {
        if i + 1 < x.len() {
            carried = (carried + x[i + 1]) * decay(i + 1);
        }
        sums[i] += carried;
    }
    sums
}

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

/// Length in time constants below which the series of the mean's variance replaces the formula, which subtracts nearly equal numbers. Bound:
/// the series is accurate to 1e-14 there.
const SERIES_BELOW: f64 = 0.02;

/// Correlation of two values of the process `apart_s` apart; 0 for a process without memory.
pub fn memory(apart_s: f64, time_constant_s: f64) -> f64 {
    if time_constant_s > 0.0 { (-apart_s.abs() / time_constant_s).exp() } else { 0.0 }
}

/// Variance of the process's mean over `length_s`, in the unit of `variance`. `variance` is that of a single value.
///
/// `variance * 2 (x - 1 + exp(-x)) / x^2` with `x` the length in time constants: the integral of the correlation over the
/// square of the length.
pub fn variance_of_mean(variance: f64, length_s: f64, time_constant_s: f64) -> f64 {
    if length_s <= 0.0 {
        return variance;
    }
    let x = length_s / time_constant_s;
    if time_constant_s <= 0.0 || x.is_infinite() {
        return 0.0;
    }
    if x < SERIES_BELOW {
        let series = [-2.0 / 5040.0, 2.0 / 720.0, -2.0 / 120.0, 2.0 / 24.0, -2.0 / 6.0, 1.0];
        return variance * series.into_iter().fold(0.0, |sum, term| sum * x + term);
    }
    variance * 2.0 * (x - 1.0 + (-x).exp()) / (x * x)
}

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
    use nalgebra::DMatrix;

    #[test]
    fn a_mean_has_the_variance_of_white_and_first_order_noise() {
        let noise = |share| ColouredNoise::new(share, 2.0);
        assert!((noise(0.0).variance_of_mean(300, 30.0) - 1.0 / 300.0).abs() < 1e-15);
        // Integral of exp(-|t - s|/2) over the square of 30 s, over 900 s2: (2*2*30 - 2*4*(1 - exp(-15)))/900.
        let expected = (120.0 - 8.0 * (1.0 - (-15.0_f64).exp())) / 900.0;
        assert!((noise(1.0).variance_of_mean(300, 30.0) - expected).abs() < 1e-12);
    }

    /// The double sum over all pairs of samples, which no formula shortens.
    #[test]
    fn the_mean_of_samples_scatters_as_their_covariance_says() {
        let noise = ColouredNoise::new(0.6, 2.0);
        let times_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let pairs = times_s.iter().flat_map(|a| times_s.iter().map(move |b| a - b));
        let direct = pairs.map(|distance_s| noise.correlation(distance_s)).sum::<f64>() / 4e4;
        // Samples 0.1 s apart under 2 s: (0.05)^2 / 12 of the first-order part.
        assert!((noise.variance_of_mean(200, 20.0) / direct - 1.0).abs() < 5e-4);
    }

    #[test]
    fn white_noise_has_as_many_samples_as_there_are() {
        assert!((50.0 * ColouredNoise::new(0.0, 2.0).variance_of_mean(50, 5.0) - 1.0).abs() < 1e-12);
        assert_eq!(ColouredNoise::new(2.0, 1.0).first_order_share_ratio, 1.0);
    }

    #[test]
    fn two_passes_make_the_full_product() {
        let t_s = [0.0, 0.1, 0.4, 1.5, 1.6];
        let x = [1.0, -2.0, 0.5, 3.0, 1.0];
        let found = correlate(&t_s, &x, 0.7);
        for i in 0..5 {
            let full: f64 = (0..5).map(|j| (-(t_s[i] - t_s[j]).abs() / 0.7).exp() * x[j]).sum();
            assert!((found[i] - full).abs() < 1e-12);
        }
        assert!(correlate(&[], &[], 1.0).is_empty());
    }

    /// Whitening is a linear map W: with C the covariance of the rows, W C W' must be the identity.
    #[test]
    fn whitened_noise_has_unit_covariance() {
        let t_s = [0.0, 0.5, 1.0, 1.5, 4.0, 4.5];
        let noise = BlockNoise { white: 0.3, first_order: 0.5 };
        let (sigma, white_sigma) = (0.7, 0.35);
        let filter = WhiteningFilter::new(t_s.iter().map(|t| (*t, noise, true)), 2.0, sigma, white_sigma);
        let covariance = DMatrix::from_fn(6, 6, |i, j| {
            let white = if i == j { noise.white * white_sigma * white_sigma } else { 0.0 };
            white + sigma * sigma * noise.first_order * crate::coloured_noise::memory(t_s[i] - t_s[j], 2.0)
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

    /// The double integral by scipy, half of it by symmetry: `2*scipy.integrate.dblquad(lambda t, s: numpy.exp(-(s-t)/2), 0, L,
    /// 0, lambda s: s, epsabs=1e-15, epsrel=1e-13)[0]/L**2` for L = 0.02, 1, 30 s.
    #[test]
    fn the_variance_of_a_mean_is_the_double_integral() {
        for (length_s, expected) in SCIPY {
            let found = variance_of_mean(1.0, length_s, 2.0);
            assert!((found / expected - 1.0).abs() < 1e-9, "{length_s} s: {found} for {expected}");
        }
    }

    const SCIPY: [(f64, f64); 3] =
        [(0.02, 0.9966749833610715), (1.0, 0.8522452777010673), (30.0, 0.1244444471635762)];

    #[test]
    fn it_goes_from_the_variance_itself_to_nothing() {
        assert_eq!(variance_of_mean(3.0, 0.0, 2.0), 3.0);
        assert_eq!(variance_of_mean(3.0, 1.0, 0.0), 0.0);
        assert_eq!(variance_of_mean(3.0, f64::INFINITY, 2.0), 0.0);
        // Series and formula meet where the one follows the other; the formula has 1e-12 there.
        let (below, above) = (variance_of_mean(1.0, 0.02 - 1e-13, 1.0), variance_of_mean(1.0, 0.02, 1.0));
        assert!((below - above).abs() < 2e-12, "{below} {above}");
    }

    #[test]
    fn memory_is_even_and_falls() {
        assert_eq!(memory(0.0, 2.0), 1.0);
        assert!((memory(-2.0, 2.0) - std::f64::consts::E.recip()).abs() < 1e-15);
        assert_eq!(memory(2.0, 2.0), memory(-2.0, 2.0));
        assert_eq!(memory(0.0, 0.0), 0.0);
    }

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
