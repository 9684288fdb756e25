//! Median and quantiles.

use std::borrow::Borrow;

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
}
