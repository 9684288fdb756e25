//! Agreement of parameter values with the rows of a log.

use crate::driven::parameters::COUNT;
use crate::driven::{Declared, Rows, Values, predict};

/// Correlation time of model and sensor errors, s: a probe's own time constant.
pub(crate) const ALIKE_S: f64 = 2.0;
/// Uncertainty of a measured housing temperature, K: one thermocouple represents a whole housing.
pub(crate) const HOUSING_SIGMA_K: f64 = 3.0;
/// Correlation time of the housing's error, s.
pub(crate) const HOUSING_ALIKE_S: f64 = 60.0;

/// Log posterior density of standard normal parameters, up to a constant; minus infinity if the model has no solution.
pub(crate) fn log_density(standard: &[f64; COUNT], rows: &Rows, declared: &Declared, count: usize) -> f64 {
    let values = Values::of_standard(standard);
    let prior = -0.5 * standard.iter().map(|z| z * z).sum::<f64>();
    let predicted = predict(rows, declared, &values, count);
    let [.., sigma_k] = values.0;
    let residual = |measured: &[f64], predicted: &[f64], sigma: f64, alike_s: f64| {
        let (mut sum, mut before): (f64, Option<(f64, f64)>) = (0.0, None);
        for i in 0..count.min(predicted.len()) {
            // Unmeasured rows are skipped. A NaN prediction is not, so that it rejects the values.
            if measured[i].is_nan() {
                continue;
            }
            let residual = measured[i] - predicted[i];
            let t_s = rows.t_s[i];
            // First-order noise: each residual minus its expectation from the previous one.
            let keep = before.map_or(0.0, |(at_s, _)| (-(t_s - at_s) / alike_s).exp());
            let news = residual - keep * before.map_or(0.0, |(_, residual)| residual);
            let spread = sigma * (1.0 - keep * keep).sqrt();
            sum += -0.5 * (news / spread).powi(2) - spread.ln();
            before = Some((t_s, residual));
        }
        sum
    };
    let density = prior
        + residual(&rows.judged[0].1, &predicted.t2_k, sigma_k, ALIKE_S)
        + residual(&rows.judged[1].1, &predicted.tc_k, HOUSING_SIGMA_K, HOUSING_ALIKE_S);
    if density.is_finite() { density } else { f64::NEG_INFINITY }
}
