//! How well values agree with the rows of a log.

use crate::parameters::COUNT;
use crate::{Declared, Readings, Values, predict};

/// What model and sensors leave is alike over so long, s: a probe's own time.
pub(crate) const ALIKE_S: f64 = 2.0;
/// Uncertainty of a measured housing temperature: one thermocouple stands for a whole housing, K.
const HOUSING_SIGMA_K: f64 = 3.0;
/// The housing's error is alike over so long, s.
const HOUSING_ALIKE_S: f64 = 60.0;

/// Logarithm of the posterior density of standard normal numbers, but for a constant; minus infinity where the model has no
/// answer.
pub(crate) fn log_density(
    standard: &[f64; COUNT],
    rows: &Readings,
    declared: &Declared,
    count: usize,
) -> f64 {
    let values = Values::of_standard(standard);
    let prior = -0.5 * standard.iter().map(|z| z * z).sum::<f64>();
    let predicted = predict(rows, declared, &values, count);
    let [.., sigma_k] = values.0;
    let residual = |measured: &[f64], said: &[f64], sigma: f64, alike_s: f64| {
        let (mut sum, mut before): (f64, Option<(f64, f64)>) = (0.0, None);
        for i in 0..count.min(said.len()) {
            // A housing that nobody measured. What the model cannot say counts.
            if measured[i].is_nan() {
                continue;
            }
            let residual = measured[i] - said[i];
            let t_s = rows.t_s[i];
            // First-order noise: each residual less what the one before lets expect.
            let keep = before.map_or(0.0, |(at_s, _)| (-(t_s - at_s) / alike_s).exp());
            let news = residual - keep * before.map_or(0.0, |(_, residual)| residual);
            let spread = sigma * (1.0 - keep * keep).sqrt();
            sum += -0.5 * (news / spread).powi(2) - spread.ln();
            before = Some((t_s, residual));
        }
        sum
    };
    let density = prior
        + residual(&rows.t2_k, &predicted.t2_k, sigma_k, ALIKE_S)
        + residual(&rows.tc_k, &predicted.tc_k, HOUSING_SIGMA_K, HOUSING_ALIKE_S);
    if density.is_finite() { density } else { f64::NEG_INFINITY }
}
