//! Posterior density of parameter values under the rows of a log, and the noise model behind it.

use crate::driven::Rows;
use crate::driven::compressor_side::{Declared, predict};
use crate::driven::parameters::{COUNT, Values};

/// Correlation time of model and sensor errors, s: a probe's own time constant.
pub(crate) const CORRELATION_S: f64 = 2.0;
/// Uncertainty of a measured housing temperature, K: one thermocouple represents a whole housing.
pub(crate) const HOUSING_SIGMA_K: f64 = 3.0;
/// Correlation time of the housing's error, s.
pub(crate) const HOUSING_CORRELATION_S: f64 = 60.0;

/// First-order noise along the rows of a log.
pub(crate) struct CorrelatedNoise {
    sigma: f64,
    correlation_s: f64,
    /// Time, s, and value of the previous row.
    last: Option<(f64, f64)>,
}

impl CorrelatedNoise {
    pub(crate) fn new(sigma: f64, correlation_s: f64) -> Self {
        CorrelatedNoise { sigma, correlation_s, last: None }
    }

    /// The noise at the next row, from a standard normal number.
    pub(crate) fn next(&mut self, t_s: f64, z: f64) -> f64 {
        let (keep, before) =
            self.last.map_or((0.0, 0.0), |(at_s, noise)| ((-(t_s - at_s) / self.correlation_s).exp(), noise));
        let noise = keep * before + self.sigma * (1.0 - keep * keep).sqrt() * z;
        self.last = Some((t_s, noise));
        noise
    }
}

/// Log posterior density of standard normal parameters, up to a constant; minus infinity if the model has no solution.
pub(crate) fn log_density(standard: &[f64; COUNT], rows: &Rows, declared: &Declared, count: usize) -> f64 {
    let values = Values::of_standard(standard);
    let prior = -0.5 * standard.iter().map(|z| z * z).sum::<f64>();
    let predicted = predict(rows, declared, &values, count);
    let [.., sigma_k] = values.0;
    let residual = |measured: &[f64], predicted: &[f64], sigma: f64, correlation_s: f64| {
        let (mut sum, mut before): (f64, Option<(f64, f64)>) = (0.0, None);
        for i in 0..count.min(predicted.len()) {
            // A NaN prediction is not skipped, so that it rejects the values.
            if measured[i].is_nan() {
                continue;
            }
            let residual = measured[i] - predicted[i];
            let t_s = rows.t_s[i];
            // First-order noise: each residual minus its expectation from the previous one.
            let keep = before.map_or(0.0, |(at_s, _)| (-(t_s - at_s) / correlation_s).exp());
            let innovation = residual - keep * before.map_or(0.0, |(_, residual)| residual);
            let spread = sigma * (1.0 - keep * keep).sqrt();
            sum += -0.5 * (innovation / spread).powi(2) - spread.ln();
            before = Some((t_s, residual));
        }
        sum
    };
    let density = prior
        + residual(&rows.judged[0].1, &predicted.t2_k, sigma_k, CORRELATION_S)
        + residual(&rows.judged[1].1, &predicted.tc_k, HOUSING_SIGMA_K, HOUSING_CORRELATION_S);
    if density.is_finite() { density } else { f64::NEG_INFINITY }
}
