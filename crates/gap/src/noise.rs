//! Noise that is correlated in time, and the whitening that makes it independent.

use crate::table::Block;
use mapper_core::NoiseColour;
use nalgebra::DMatrix;

/// Covariance of block means of noise with standard deviation 1: white, and first-order in the declared share.
///
/// `C_ij = (1 - c^2) delta_ij/n_i + c^2 mean_kl exp(-|t_k - t_l|/tau)`, k in block i, l in block j.
pub fn block_covariance(t_s: &[f64], blocks: &[Block], colour: NoiseColour) -> DMatrix<f64> {
    let (c2, tau_s) = (colour.first_order_share_ratio.powi(2), colour.time_constant_s.max(1e-3));
    let n = blocks.len();
    let mut covariance = DMatrix::zeros(n, n);
    for i in 0..n {
        let of_i = &t_s[blocks[i].samples.clone()];
        for j in 0..=i {
            let of_j = &t_s[blocks[j].samples.clone()];
            let apart_s = blocks[i].mean_s - blocks[j].mean_s;
            let mut value = if apart_s > 12.0 * tau_s {
                0.0
            } else if i == j || of_i.len().min(of_j.len()) < 4 {
                let pairs = of_i.iter().flat_map(|a| of_j.iter().map(move |b| (a - b).abs()));
                pairs.map(|apart_s| (-apart_s / tau_s).exp()).sum::<f64>() / (of_i.len() * of_j.len()) as f64
            } else {
                // Blocks do not overlap: the exponential of the distance factors.
                let from = |times: &[f64], mean_s: f64, sign: f64| {
                    times.iter().map(|t| (sign * (t - mean_s) / tau_s).exp()).sum::<f64>()
                        / times.len() as f64
                };
                (-apart_s / tau_s).exp()
                    * from(of_i, blocks[i].mean_s, -1.0)
                    * from(of_j, blocks[j].mean_s, 1.0)
            };
            value *= c2;
            if i == j {
                value += (1.0 - c2) / of_i.len() as f64;
            }
            covariance[(i, j)] = value;
            covariance[(j, i)] = value;
        }
    }
    covariance
}

/// Lower Cholesky factor, kept to whiten many vectors.
#[derive(Debug, Clone)]
pub struct Factor {
    lower: DMatrix<f64>,
}

impl Factor {
    /// Factor of a covariance; `None` where it is not positive definite.
    pub fn new(covariance: DMatrix<f64>) -> Option<Factor> {
        Some(Factor { lower: covariance.cholesky()?.unpack() })
    }

    /// Independent values of standard deviation `sigma`.
    pub fn identity(n: usize, sigma: f64) -> Factor {
        Factor { lower: DMatrix::identity(n, n) * sigma }
    }

    /// `L^-1 v`, in place.
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

    #[test]
    fn whitening_undoes_the_covariance() {
        // L^-1 C L^-T is the identity: whiten the columns, then the rows.
        let t_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let blocks: Vec<Block> = [(0, 1), (1, 2), (2, 10), (10, 60), (60, 110), (110, 200)]
            .iter()
            .map(|&(a, b)| {
                let mean_s = t_s[a..b].iter().sum::<f64>() / (b - a) as f64;
                Block { samples: a..b, mean_s, spread_s: 0.0, since_jump_s: mean_s }
            })
            .collect();
        let c = block_covariance(&t_s, &blocks, NoiseColour::default());
        // Direct double sum, for every pair of blocks.
        for (i, a) in blocks.iter().enumerate() {
            for (j, b) in blocks.iter().enumerate() {
                let mut sum = 0.0;
                for k in a.samples.clone() {
                    for l in b.samples.clone() {
                        sum +=
                            0.36 * (-(t_s[k] - t_s[l]).abs() / 2.0).exp() + if k == l { 0.64 } else { 0.0 };
                    }
                }
                let direct = sum / (a.samples.len() * b.samples.len()) as f64;
                // Covariances beyond twelve time constants (6e-6) are left out.
                assert!((c[(i, j)] - direct).abs() < 1e-5 * direct.max(1.0), "{i} {j}");
            }
        }
        let factor = Factor::new(c.clone()).unwrap();
        let mut whitened = c;
        for _ in 0..2 {
            for mut column in whitened.column_iter_mut() {
                factor.whiten(column.as_mut_slice());
            }
            whitened.transpose_mut();
        }
        assert!((whitened - DMatrix::identity(6, 6)).abs().max() < 1e-12);
    }
}
