//! Quantiles of distributions, for confidence intervals.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
use statrs::function::beta::inv_beta_reg;

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

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::ChiSquared;

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
}
