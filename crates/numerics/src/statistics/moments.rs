//! Means and spreads.

use std::borrow::Borrow;

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
