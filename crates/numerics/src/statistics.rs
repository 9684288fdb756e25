//! Statistics of lists of numbers.
//!
//! No function except [`range`] skips values silently. The result is `None` if there are no values, and NaN if one of them is NaN, as in numpy. To ignore
//! gaps, filter them first.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
use statrs::function::beta::inv_beta_reg;
use std::borrow::Borrow;

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
    /// underflows or is not a number.
    pub fn quantile(&self, share: f64) -> f64 {
        let upper = self.uses_upper_tail();
        let (near, far) = self.tail_probabilities();
        let lies_between = near > far;
        if !lies_between {
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

/// Share below the upper end of a 95 % interval. Source: its definition.
pub const SHARE_975: f64 = 0.975;
/// Share below the lower end. Source: its definition.
pub const SHARE_025: f64 = 0.025;

/// 97.5 % quantile of the standard normal distribution. Source: half of a 95 % interval, standard errors.
pub const NORMAL_975: f64 = 1.959_963_984_540_054;

/// 95 % quantile of the standard normal distribution. Source: a quantity this far above a threshold exceeds it in 95 of 100 cases.
pub const NORMAL_95: f64 = 1.644_853_626_951_472;

/// Threshold for a hint, in standard deviations. Bound: by chance exceeded once in 22 times.
pub const HINT_SIGMAS: f64 = 2.0;
/// Threshold for a doubt about one number, in standard deviations. Bound: by chance exceeded once in 370 times.
pub const DOUBT_SIGMAS: f64 = 3.0;
/// Threshold for excluding one of hundreds of numbers, in standard deviations. Bound: by chance exceeded once in 16,000 times.
pub const EXCLUDE_SIGMAS: f64 = 4.0;

/// Minimum number of values for a mean and its scatter. Bound: the relative error of their standard deviation, 1 / sqrt(2 (n - 1)), is a
/// quarter.
pub const MIN_VALUES: usize = 8;

/// 95 % quantile of chi-square with one degree of freedom. Source: the square of [`NORMAL_975`].
pub const CHI_SQUARE_1_95: f64 = 3.841_458_820_694_124;

/// Quantile of the standard normal distribution at `share` (between 0 and 1); otherwise `None`.
pub fn normal_quantile(share: f64) -> Option<f64> {
    (share > 0.0 && share < 1.0).then(|| Normal::standard().inverse_cdf(share))
}

/// Quantile of Student's t distribution at `share` (between 0 and 1), for `degrees_of_freedom` above 0; otherwise `None`.
pub fn student_quantile(share: f64, degrees_of_freedom: f64) -> Option<f64> {
    let inside = share > 0.0 && share < 1.0;
    let distribution = StudentsT::new(0.0, 1.0, degrees_of_freedom).ok().filter(|_| inside)?;
    Some(distribution.inverse_cdf(share))
}

/// The exact 95 % interval of a probability, from `hits` out of `trials` (Clopper and Pearson 1934); 0 to 1 without trials. The counts may
/// be fractions: `n` independent values between 0 and 1 with mean `m` count as `n m` hits.
pub fn share_interval_95(hits: f64, trials: f64) -> (f64, f64) {
    let misses = trials - hits;
    let low = if hits > 0.0 { inv_beta_reg(hits, misses.max(0.0) + 1.0, SHARE_025) } else { 0.0 };
    let high = if misses > 0.0 { inv_beta_reg(hits.max(0.0) + 1.0, misses, SHARE_975) } else { 1.0 };
    (low, high)
}

/// Arithmetic mean, in the unit of the values; `None` without values, NaN if one of them is NaN.
pub fn mean<T: Borrow<f64>>(values: impl IntoIterator<Item = T>) -> Option<f64> {
    let (sum, count) =
        values.into_iter().fold((0.0, 0usize), |(sum, count), value| (sum + *value.borrow(), count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Root mean square, in the unit of the values; `None` without values, NaN if one of them is NaN.
pub fn rms<T: Borrow<f64>>(values: impl IntoIterator<Item = T>) -> Option<f64> {
    mean(values.into_iter().map(|value| value.borrow().powi(2))).map(f64::sqrt)
}

/// Standard deviation of the population from which the values are drawn (sum of squares over `n - 1`), in their unit;
/// `None` for fewer than two, NaN if one of them is NaN.
pub fn standard_deviation<T: Borrow<f64>>(values: impl IntoIterator<Item = T>) -> Option<f64> {
    let values: Vec<f64> = values.into_iter().map(|value| *value.borrow()).collect();
    let mean = mean(&values)?;
    // Two passes, because the sum of squares minus the square of the sum loses all digits if the spread is small.
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}

/// The middle value, or the mean of the two middle ones if their number is even. `None` without values, NaN if one of
/// them is NaN.
///
/// In the unit of the values. Source: R. J. Hyndman, Y. Fan, "Sample quantiles in statistical packages", The American
/// Statistician 50 (1996): all their continuous definitions agree on the median.
pub fn median<T: Borrow<f64>>(values: impl IntoIterator<Item = T>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().map(|value| *value.borrow()).collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    if values.iter().any(|value| value.is_nan()) {
        return Some(f64::NAN);
    }
    let even = values.len().is_multiple_of(2);
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let upper = *upper;
    // If the number is even, at least one value lies below the upper of the two middle ones.
    let lower = if even { below.iter().copied().fold(f64::NEG_INFINITY, f64::max) } else { upper };
    Some(midpoint(lower, upper))
}

/// The smallest and the largest value; infinity and minus infinity without values. NaN does not count.
pub fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// [`median`] of sorted values without NaN, e.g. those of a sliding window.
pub fn median_of_sorted(sorted: &[f64]) -> Option<f64> {
    let upper = sorted.get(sorted.len() / 2)?;
    Some(midpoint(sorted[(sorted.len() - 1) / 2], *upper))
}

/// The value whose rank is nearest to `share` (0 to 1) of the way from the smallest to the largest: always one of the values.
/// `None` without values, NaN if a value is NaN.
///
/// In the unit of the values. For searches whose path depends on the last digit; use [`median`] and [`quantile`] for results.
pub fn nearest_rank<T: Borrow<f64>>(values: impl IntoIterator<Item = T>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().map(|value| *value.borrow()).collect();
    let place = (share.clamp(0.0, 1.0) * values.len().checked_sub(1)? as f64).round() as usize;
    if values.iter().any(|value| value.is_nan()) {
        return Some(f64::NAN);
    }
    Some(*values.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// Mean of two values, which may be equal infinities.
fn midpoint(lower: f64, upper: f64) -> f64 {
    if lower == upper { upper } else { 0.5 * (lower + upper) }
}

/// The value below which `share` (0 to 1) of the values lie, by linear interpolation between the sorted values: the smallest at 0, the
/// largest at 1. `None` without values or with another share, NaN if a value is NaN.
///
/// In the unit of the values. Type 7 of Hyndman and Fan (1996), the default of numpy, R and spreadsheets.
pub fn quantile<T: Borrow<f64>>(values: impl IntoIterator<Item = T>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().map(|value| *value.borrow()).collect();
    if values.is_empty() || !(0.0..=1.0).contains(&share) {
        return None;
    }
    if values.iter().any(|value| value.is_nan()) {
        return Some(f64::NAN);
    }
    let place = share * (values.len() - 1) as f64;
    let index = place.floor() as usize;
    let (_, lower, above) = values.select_nth_unstable_by(index, f64::total_cmp);
    let lower = *lower;
    let upper = above.iter().copied().reduce(f64::min).unwrap_or(lower);
    let fraction = place - index as f64;
    // Equal infinities have no difference.
    Some(if fraction == 0.0 || lower == upper { lower } else { lower + fraction * (upper - lower) })
}

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
    use proptest::prelude::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

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
        let none =
            [BoundedNormal { mean: f64::NAN, ..bounded }, BoundedNormal { sigma: f64::NAN, ..bounded }];
        assert!(none.iter().all(|bounded| [0.0, 1.0].contains(&bounded.quantile(0.5))), "{none:?}");
    }

    const SCIPY: [(f64, f64, f64, f64, f64, f64, f64); 6] = [
        (0.0, 0.3, 0.0, 1.0, 0.49957093966680316, 0.03766588368334846, 0.6685974050843215),
        (-0.03, 0.015, 0.0, 1.0, 0.022750131948179195, 0.0006605025443174456, 0.01881155881404778),
        (-0.1, 0.01, 0.0, 1.0, 7.61985302416047e-24, 0.00010428370091844497, 0.003589826578120389),
        (0.05, 0.02, 0.0, 1.0, 0.9937903346742238, 0.024993310928193343, 0.08925254246345682),
        (1.1, 0.05, 0.0, 1.0, 0.0227501319481791, 0.9581362009771772, 0.9994676506664197),
        (0.4, 0.1, 0.0, 1.0, 0.9999683277715792, 0.2718610835161479, 0.5959977515700374),
    ];

    /// scipy: `scipy.stats.norm.ppf(0.975)`, `scipy.stats.chi2.ppf(0.95, 1)`; statrs as a second reference.
    #[test]
    fn the_constants_are_those_of_scipy() {
        assert!((NORMAL_975 - 1.959963984540054).abs() < 1e-15);
        assert!((NORMAL_95 - normal_quantile(0.95).unwrap()).abs() < 1e-10);
        assert!((CHI_SQUARE_1_95 - 3.841458820694124).abs() < 1e-14);
        assert!((NORMAL_975 - normal_quantile(0.975).unwrap()).abs() < 1e-10);
        assert_eq!(normal_quantile(1.0), None);
        assert_eq!(normal_quantile(f64::NAN), None);
        assert!((CHI_SQUARE_1_95 - ChiSquared::new(1.0).unwrap().inverse_cdf(0.95)).abs() < 1e-6);
    }

    /// scipy: `scipy.stats.norm.ppf` of 0.975, 0.9995 and 1 - 0.00025/2.
    #[test]
    fn normal_quantiles_are_those_of_scipy() {
        for (share, expected) in
            [(0.975, 1.959963984540054), (0.9995, 3.2905267314919255), (0.999875, 3.662259930887615)]
        {
            assert!((normal_quantile(share).unwrap() - expected).abs() < 1e-6, "{share}");
        }
        assert_eq!(normal_quantile(1.0), None);
    }

    /// scipy: `scipy.stats.t.ppf(0.975, n)` for n = 1, 2, 3, 10, 1000.
    #[test]
    fn students_quantiles_are_those_of_scipy() {
        for (freedom, expected) in SCIPY_T {
            let found = student_quantile(0.975, freedom).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-9, "{freedom}: {found} for {expected}");
        }
        assert_eq!(student_quantile(0.975, 0.0), None);
        assert_eq!(student_quantile(1.0, 3.0), None);
        assert_eq!(student_quantile(0.5, f64::NAN), None);
    }

    const SCIPY_T: [(f64, f64); 5] = [
        (1.0, 12.706204736174694),
        (2.0, 4.302652729749462),
        (3.0, 3.1824463052837078),
        (10.0, 2.228138851986274),
        (1000.0, 1.9623390808264083),
    ];

    /// numpy 2 on `x = [0.3, -1.2, 5.5, 2.25]`: `x.mean()`, `numpy.sqrt((x**2).mean())`, `x.std(ddof=1)`.
    #[test]
    fn moments_are_those_of_numpy() {
        let values = [0.3, -1.2, 5.5, 2.25];
        assert!((mean(values).unwrap() - 1.7125).abs() < 1e-15);
        assert!((rms(values).unwrap() - 3.0349011516027997).abs() < 1e-15);
        assert!((standard_deviation(values).unwrap() - 2.893203242083072).abs() < 1e-15);
    }

    #[test]
    fn a_small_spread_about_a_large_mean_keeps_its_digits() {
        // Two values 2 apart: 2/sqrt(2), exactly representable values at 1e9.
        let found = standard_deviation([1e9 - 1.0, 1e9 + 1.0]).unwrap();
        assert!((found - 2f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn nothing_gives_nothing_and_nan_gives_nan() {
        assert_eq!((mean::<f64>([]), rms::<f64>([]), standard_deviation([1.0])), (None, None, None));
        assert!(mean([1.0, f64::NAN]).unwrap().is_nan() && rms([f64::NAN]).unwrap().is_nan());
        assert!(standard_deviation([1.0, f64::NAN]).unwrap().is_nan());
    }

    #[test]
    fn the_median_is_the_middle_or_the_mean_of_both_middles() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median([7.0]), Some(7.0));
        assert_eq!(median::<f64>([]), None);
        assert!(median([1.0, f64::NAN, 2.0]).unwrap().is_nan());
        assert_eq!(median([f64::INFINITY, f64::INFINITY]), Some(f64::INFINITY));
    }

    /// numpy 2: `numpy.quantile([0.3, -1.2, 5.5, 2.25, 2.0, 0.0, 7.125], p)`.
    #[test]
    fn quantiles_are_those_of_numpy() {
        let values = [0.3, -1.2, 5.5, 2.25, 2.0, 0.0, 7.125];
        for (share, expected) in NUMPY {
            let found = quantile(values, share).unwrap();
            assert!((found - expected).abs() < 1e-14, "{share}: {found} for {expected}");
        }
        assert_eq!(quantile::<f64>([], 0.5), None);
        assert_eq!(quantile(values, 1.1), None);
        assert_eq!(quantile(values, f64::NAN), None);
        assert!(quantile([f64::NAN, 1.0], 0.5).unwrap().is_nan());
    }

    #[test]
    fn the_nearest_rank_is_one_of_the_values() {
        let values = [4.0, 1.0, 2.0, 3.0];
        assert_eq!(nearest_rank(values, 0.0), Some(1.0));
        assert_eq!(nearest_rank(values, 0.6), Some(3.0));
        assert_eq!(nearest_rank(values, 1.0), Some(4.0));
        assert_eq!(nearest_rank::<f64>([], 0.5), None);
    }

    const NUMPY: [(f64, f64); 6] = [
        (0.0, -1.2),
        (0.1, -0.47999999999999987),
        (0.25, 0.15),
        (0.5, 2.0),
        (0.95, 6.637499999999999),
        (1.0, 7.125),
    ];

    proptest! {
        #[test]
        fn the_median_is_the_quantile_of_one_half(values in prop::collection::vec(-1e6..1e6f64, 1..40)) {
            let (median, quantile) = (median(&values).unwrap(), quantile(&values, 0.5).unwrap());
            // A few roundings of values up to 1e6.
            prop_assert!((median - quantile).abs() < 1e-9);
            let mut sorted = values;
            sorted.sort_by(f64::total_cmp);
            prop_assert_eq!(median_of_sorted(&sorted), Some(median));
        }

        #[test]
        fn quantiles_rise_with_the_share(
            values in prop::collection::vec(-1e6..1e6f64, 1..40), a in 0.0..1.0f64, b in 0.0..1.0f64,
        ) {
            let (low, high) = (a.min(b), a.max(b));
            prop_assert!(quantile(&values, low).unwrap() <= quantile(&values, high).unwrap() + 1e-9);
        }
    }

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
