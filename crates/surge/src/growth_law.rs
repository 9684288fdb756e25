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
    pub(crate) fn part(self, margin_ratio: f64) -> f64 {
        let part = |margin: f64| margin.max(1e-6).powf(-self.exponent);
        (part(margin_ratio) - part(self.onset_ratio)).max(0.0)
    }
}

/// The growing part up to a factor, and the variation that was read there.
pub(crate) type Read = (f64, Variation);

/// Rounds of the reweighted fit; the variance moves by less than its own error from one to the next.
const ROUNDS: usize = 5;

/// Logarithm of the likelihood of a channel's variations for the most likely level and size, neither negative. A variance of
/// so many degrees of freedom follows a chi-squared law.
pub(crate) fn log_likelihood(read: &[Read]) -> f64 {
    let least = 0.2 * read.iter().map(|(_, v)| v.variance).fold(f64::INFINITY, f64::min);
    let mut expected: Vec<f64> = read.iter().map(|(_, variation)| variation.variance).collect();
    for _ in 0..ROUNDS {
        // Weighted least squares; the weights are those of variances.
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
        if level < least {
            level = least;
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

/// By how much likelier a variance is any than that of a known level, natural logarithm; 0 where it is smaller.
pub(crate) fn excess(read: Variation, level: f64) -> f64 {
    let ratio = read.variance / level;
    if ratio > 1.0 { 0.5 * read.degrees_of_freedom * (ratio - 1.0 - ratio.ln()) } else { 0.0 }
}
