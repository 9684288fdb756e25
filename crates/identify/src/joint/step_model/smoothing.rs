//! Smooths the inputs of the model along a step.
//!
//! The model takes T1, Tc, flow and pressures as read. Their noise adds to that of T2, and it biases the fit: a lag of the fitted probe
//! smooths the prediction and could "explain" the noise, and a smaller surface slope could too. Over ten seconds a real change in a window is
//! at most a cubic. Noise with a correlation time of two seconds is not.

use mapper_numerics::statistics::MIN_VALUES;
use nalgebra::{Matrix4, Vector4};

/// Half the width of the local cubic fit, s. Bound: far below the time constants of housings, far above the correlation time of sensor
/// noise.
const HALF_S: f64 = 10.0;
/// Half the width of the local fit at the first row, s. Bound: long enough for a cubic through noisy readings.
pub(crate) const SHORTEST_HALF_S: f64 = 3.0;

/// For each row, the neighbouring rows and their weights in a local cubic.
#[derive(Debug, Clone, Default)]
pub(crate) struct Smoother {
    weights: Vec<(usize, Vec<f64>)>,
}

impl Smoother {
    /// Builds the weights for rows at these times.
    pub(crate) fn new(t_s: &[f64]) -> Self {
        let weights = (0..t_s.len())
            .map(|i| {
                // Changes are faster soon after a jump.
                let half_s = (SHORTEST_HALF_S + 0.5 * (t_s[i] - t_s[0])).min(HALF_S);
                let start = t_s.partition_point(|t| *t < t_s[i] - half_s);
                let end = t_s.partition_point(|t| *t <= t_s[i] + half_s);
                let powers = |j: usize| {
                    let x = (t_s[j] - t_s[i]) / HALF_S;
                    Vector4::new(1.0, x, x * x, x * x * x)
                };
                let mut normal = Matrix4::zeros();
                for j in start..end {
                    let p = powers(j);
                    normal += p * p.transpose();
                }
                let factors = if end - start < MIN_VALUES { None } else { normal.cholesky() };
                match factors {
                    None => (i, vec![1.0]),
                    Some(factors) => {
                        let at_row = factors.solve(&Vector4::new(1.0, 0.0, 0.0, 0.0));
                        (start, (start..end).map(|j| at_row.dot(&powers(j))).collect())
                    }
                }
            })
            .collect();
        Smoother { weights }
    }

    /// Returns the smoothed column.
    pub(crate) fn apply(&self, column: &[f64]) -> Vec<f64> {
        self.weights
            .iter()
            .map(|(start, weights)| {
                let around = column.get(*start..).unwrap_or(&[]);
                weights.iter().zip(around).map(|(weight, value)| weight * value).sum()
            })
            .collect()
    }
}
