//! Each hypothesis as the only member of the explanation.

use crate::hypotheses::{Likelihood, Priors};

/// A hypothesis as the only member of the explanation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Single {
    /// Position among the hypotheses.
    pub index: usize,
    /// Its odds against no hypothesis.
    pub odds: f64,
    /// Its size: mean.
    pub value: f64,
    /// One standard deviation of `value`.
    pub sigma: f64,
}

impl Likelihood {
    /// Every hypothesis as the only member of the explanation; `None` if the covariance of the declared parameters is singular.
    pub fn singles(&self, priors: &Priors) -> Option<Vec<Single>> {
        let marginal = self.marginalise(&priors.always)?;
        let single = |(index, hypothesis): (usize, &crate::hypotheses::Hypothesis)| {
            let (precision, precision_mean) = marginal.of_parameter(index);
            let scaled = 1.0 + hypothesis.sigma.powi(2) * precision;
            let value = hypothesis.sigma.powi(2) * precision_mean / scaled;
            let possible = !(hypothesis.at_least_zero && value < 0.0);
            let odds = (0.5 * value * precision_mean - 0.5 * scaled.ln() + hypothesis.ln_prior).exp();
            possible.then(|| Single { index, odds, value, sigma: hypothesis.sigma / scaled.sqrt() })
        };
        Some(priors.hypotheses.iter().enumerate().filter_map(single).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypotheses::Balance;
    use nalgebra::{DMatrix, DVector};

    /// One reading of 3 with a standard error of 1 for a size of 2: by hand 0.8 of the reading, and the ratio of two normal densities.
    #[test]
    fn a_single_hypothesis_is_a_text_book_case() {
        let mut likelihood = Likelihood::new(1);
        let balance = Balance {
            residual: DVector::from_element(1, 3.0),
            covariance: DMatrix::from_element(1, 1, 1.0),
            columns: DMatrix::from_element(1, 1, 1.0),
        };
        likelihood.add(&balance).unwrap();
        let singles = likelihood.singles(&Priors::even(Vec::new(), &[2.0], 0.1)).unwrap();
        assert_eq!(singles.len(), 1, "{singles:?}");
        let single = &singles[0];
        let density = |variance: f64| (-4.5 / variance).exp() / variance.sqrt();
        assert!((single.value - 2.4).abs() < 1e-12 && (single.sigma - 0.8_f64.sqrt()).abs() < 1e-12);
        assert!((single.odds / (0.1 * density(5.0) / density(1.0)) - 1.0).abs() < 1e-12);
    }
}
