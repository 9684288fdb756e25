//! The law by which a variation grows, fitted to what was read: a level, and a part that has no bound at surge.

use crate::variation::Variation;

/// How the growing part goes with the surge margin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GrowthLaw {
    /// The variance goes with the inverse of the margin to this power: 1 by theory.
    pub(crate) exponent: f64,
    /// Margin at which it begins.
    pub(crate) onset_ratio: f64,
}

impl GrowthLaw {
    /// The growing part at a margin, up to a factor.
    fn at(self, margin_ratio: f64) -> f64 {
        let part = |margin: f64| margin.max(1e-6).powf(-self.exponent);
        (part(margin_ratio) - part(self.onset_ratio)).max(0.0)
    }
}

/// Rounds of the reweighted fit; the variance moves by less than its own error from one to the next.
const ROUNDS: usize = 5;

/// Logarithm of the likelihood of a channel's variations at these margins, where level and size of the growth are the most
/// likely ones; a variance of so many degrees of freedom follows a chi-squared law.
pub(crate) fn log_likelihood(variations: &[(f64, Variation)], law: GrowthLaw) -> f64 {
    let parts: Vec<f64> = variations.iter().map(|(margin_ratio, _)| law.at(*margin_ratio)).collect();
    fitted(variations, &parts)
}

/// The same without any growth.
pub(crate) fn log_likelihood_without(variations: &[(f64, Variation)]) -> f64 {
    fitted(variations, &vec![0.0; variations.len()])
}

fn fitted(variations: &[(f64, Variation)], parts: &[f64]) -> f64 {
    let all: f64 = variations.iter().map(|(_, variation)| variation.degrees_of_freedom).sum();
    let least = variations.iter().map(|(_, v)| v.variance_ratio).fold(f64::INFINITY, f64::min);
    let flat = variations.iter().map(|(_, v)| v.variance_ratio * v.degrees_of_freedom).sum::<f64>() / all;
    let (mut level, mut size) = (if parts.iter().any(|part| *part > 0.0) { least } else { flat }, 0.0);
    let floor = 0.05 * least;
    for _ in 0..ROUNDS {
        // Weighted least squares for level and size; the weights are those of variances.
        let (mut s, mut sg, mut sgg, mut sv, mut sgv) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((_, variation), part) in variations.iter().zip(parts) {
            let expected = level + size * part;
            // At the first round what was read has to stand for what is expected.
            let scale = if size > 0.0 { expected } else { variation.variance_ratio.max(expected) };
            let weight = variation.degrees_of_freedom / (scale * scale);
            s += weight;
            sg += weight * part;
            sgg += weight * part * part;
            sv += weight * variation.variance_ratio;
            sgv += weight * part * variation.variance_ratio;
        }
        let determinant = s * sgg - sg * sg;
        let slope = if determinant > 1e-12 * s * sgg { (s * sgv - sg * sv) / determinant } else { 0.0 };
        (level, size) = if slope > 0.0 { ((sv - slope * sg) / s, slope) } else { (flat, 0.0) };
        level = level.max(floor);
    }
    variations
        .iter()
        .zip(parts)
        .map(|((_, variation), part)| {
            let expected = level + size * part;
            -0.5 * variation.degrees_of_freedom * (expected.ln() + variation.variance_ratio / expected)
        })
        .sum()
}
