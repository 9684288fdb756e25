//! A standard deviation that outliers hardly affect.

use super::order::median;
use std::borrow::Borrow;

/// Standard deviation over median absolute value of a normal distribution about 0. Source: 1 / quantile(0.75).
pub const MEDIAN_SIZE_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// Standard deviation of normally distributed deviations about 0, in their unit, from their median absolute value: up to half of them may
/// be outliers. `None` without values, NaN if one of them is NaN.
///
/// Source: F. R. Hampel, "The influence curve and its role in robust estimation", J. Am. Stat. Assoc. 69 (1974).
pub fn robust_sigma<T: Borrow<f64>>(deviations: impl IntoIterator<Item = T>) -> Option<f64> {
    median(deviations.into_iter().map(|deviation| deviation.borrow().abs()))
        .map(|size| MEDIAN_SIZE_TO_SIGMA * size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn the_factor_is_that_of_the_normal_distribution() {
        let quartile = Normal::standard().inverse_cdf(0.75);
        // statrs inverts to 1e-12 or better.
        assert!((MEDIAN_SIZE_TO_SIGMA * quartile - 1.0).abs() < 1e-11);
    }

    #[test]
    fn evenly_spread_quantiles_of_a_normal_distribution_give_its_sigma() {
        let normal = Normal::standard();
        let mut values: Vec<f64> =
            (0..1000).map(|i| 2.5 * normal.inverse_cdf((f64::from(i) + 0.5) / 1000.0)).collect();
        // A thousand points leave 1/1000 of the density at the quartile.
        assert!((robust_sigma(&values).unwrap() - 2.5).abs() < 0.005);
        // One value in ten far off: 40 % of the others' lie within the median of sizes, not 50.
        for value in values.iter_mut().step_by(10) {
            *value = 1e9;
        }
        assert!(robust_sigma(values).unwrap() < 3.0);
    }
}
