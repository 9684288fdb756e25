//! The growth law of the variation, fitted to the readings: a constant level, and a part that diverges at surge.

use crate::surge::variation::Variation;

/// Dependence of the growing part on the surge margin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GrowthLaw {
    /// The variance is proportional to the inverse of the margin to this power: 1 by theory.
    pub(crate) exponent: f64,
    /// Margin at which the growth begins.
    pub(crate) onset_ratio: f64,
}

impl GrowthLaw {
    /// The growing part at a margin, without its scale factor.
    pub(crate) fn growth_at(self, margin_ratio: f64) -> f64 {
        let part = |margin: f64| margin.max(1e-6).powf(-self.exponent);
        (part(margin_ratio) - part(self.onset_ratio)).max(0.0)
    }
}

/// The growing part without its scale factor, and the measured variation at that reading.
pub(crate) type Observation = (f64, Variation);

/// Iterations of the reweighted fit; the variance then changes by less than its own error.
const ROUNDS: usize = 5;

/// Log-likelihood of a channel's variations at the most likely non-negative level and size. A variance follows a chi-squared
/// distribution with its degrees of freedom.
pub(crate) fn log_likelihood(read: &[Observation]) -> f64 {
    let level_min = 0.2 * read.iter().map(|(_, v)| v.variance).fold(f64::INFINITY, f64::min);
    let mut expected: Vec<f64> = read.iter().map(|(_, variation)| variation.variance).collect();
    for _ in 0..ROUNDS {
        // Weighted least squares; the weights are inverse variances of the measured variances.
        let (mut s, mut sg, mut sgg, mut sv, mut sgv) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((part, variation), expected) in read.iter().zip(&expected) {
            let weight = variation.degrees_of_freedom / (expected * expected);
            s += weight;
            sg += weight * part;
            sgg += weight * part * part;
            sv += weight * variation.variance;
            sgv += weight * part * variation.variance;
        }
        let determinant = s * sgg - sg * sg;
        let slope = if determinant > 1e-12 * s * sgg { (s * sgv - sg * sv) / determinant } else { 0.0 };
        let mut size = slope.max(0.0);
        let mut level = (sv - size * sg) / s;
        if level < level_min {
            level = level_min;
            size = if sgg > 0.0 { ((sgv - level * sg) / sgg).max(0.0) } else { 0.0 };
        }
        for ((part, _), expected) in read.iter().zip(&mut expected) {
            *expected = level + size * part;
        }
    }
    read.iter()
        .zip(&expected)
        .map(|((_, variation), expected)| {
            -0.5 * variation.degrees_of_freedom * (expected.ln() + variation.variance / expected)
        })
        .sum()
}

/// Log-likelihood ratio of a free variance to one of known level; 0 if the variance is smaller.
pub(crate) fn log_likelihood_excess(read: Variation, level: f64) -> f64 {
    let ratio = read.variance / level;
    if ratio > 1.0 { 0.5 * read.degrees_of_freedom * (ratio - 1.0 - ratio.ln()) } else { 0.0 }
}
