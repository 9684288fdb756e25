//! A normal distribution truncated at the bounds of a quantity.

use statrs::distribution::{ContinuousCDF, Normal};

/// The part of a normal distribution between two bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundedNormal {
    /// Mean of the untruncated distribution.
    pub mean: f64,
    /// Standard deviation of the untruncated distribution, above 0.
    pub sigma: f64,
    /// Lowest value.
    pub low: f64,
    /// Highest value, above `low`.
    pub high: f64,
}

impl BoundedNormal {
    /// Probability of the untruncated distribution between the bounds.
    pub fn mass(&self) -> f64 {
        let (near, far) = self.tail_probabilities();
        near - far
    }

    /// Quantile of the truncated distribution at `share` (between 0 and 1); the nearest bound if the probability between the bounds
    /// underflows.
    pub fn quantile(&self, share: f64) -> f64 {
        let upper = self.uses_upper_tail();
        let (near, far) = self.tail_probabilities();
        if near <= far {
            return if upper { self.low } else { self.high };
        }
        let tail_share = if upper { share } else { 1.0 - share };
        // A tail below 1 ulp has an infinite quantile, which the bounds clamp.
        let sigmas = -Normal::standard().inverse_cdf((near - tail_share * (near - far)).clamp(0.0, 1.0));
        (self.mean + self.sigma * if upper { sigmas } else { -sigmas }).clamp(self.low, self.high)
    }

    /// Whether the centre of the bounds lies above the mean: the upper tail is then used, because it is more exact.
    fn uses_upper_tail(&self) -> bool {
        0.5 * (self.low + self.high) >= self.mean
    }

    /// Probability of the untruncated distribution beyond the bound nearer to the mean, and beyond the other bound.
    fn tail_probabilities(&self) -> (f64, f64) {
        let normal = Normal::standard();
        let (low, high) = ((self.low - self.mean) / self.sigma, (self.high - self.mean) / self.sigma);
        if self.uses_upper_tail() {
            (normal.sf(low), normal.sf(high))
        } else {
            (normal.cdf(high), normal.cdf(low))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy: `truncnorm((low-mean)/sigma, (high-mean)/sigma, loc=mean, scale=sigma)`, its `ppf`, and
    /// `norm.cdf(high, mean, sigma) - norm.cdf(low, mean, sigma)` (`norm.sf` in the far tail).
    #[test]
    fn mass_and_quantiles_are_those_of_scipy() {
        for (mean, sigma, low, high, mass, at_10, at_975) in SCIPY {
            let bounded = BoundedNormal { mean, sigma, low, high };
            assert!((bounded.mass() / mass - 1.0).abs() < 1e-6, "{bounded:?}: {}", bounded.mass());
            for (share, expected) in [(0.1, at_10), (0.975, at_975)] {
                let found = bounded.quantile(share);
                assert!((found - expected).abs() < 1e-6 * sigma, "{bounded:?} at {share}: {found}");
            }
        }
    }

    #[test]
    fn where_nothing_is_left_the_nearer_bound_stands() {
        let bounded = BoundedNormal { mean: -1e3, sigma: 1.0, low: 0.0, high: 1.0 };
        assert_eq!((bounded.mass(), bounded.quantile(0.5)), (0.0, 0.0));
        let bounded = BoundedNormal { mean: 1e3, ..bounded };
        assert_eq!((bounded.mass(), bounded.quantile(0.5)), (0.0, 1.0));
    }

    const SCIPY: [(f64, f64, f64, f64, f64, f64, f64); 6] = [
        (0.0, 0.3, 0.0, 1.0, 0.49957093966680316, 0.03766588368334846, 0.6685974050843215),
        (-0.03, 0.015, 0.0, 1.0, 0.022750131948179195, 0.0006605025443174456, 0.01881155881404778),
        (-0.1, 0.01, 0.0, 1.0, 7.61985302416047e-24, 0.00010428370091844497, 0.003589826578120389),
        (0.05, 0.02, 0.0, 1.0, 0.9937903346742238, 0.024993310928193343, 0.08925254246345682),
        (1.1, 0.05, 0.0, 1.0, 0.0227501319481791, 0.9581362009771772, 0.9994676506664197),
        (0.4, 0.1, 0.0, 1.0, 0.9999683277715792, 0.2718610835161479, 0.5959977515700374),
    ];
}
