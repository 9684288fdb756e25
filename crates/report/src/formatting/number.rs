//! Numbers as text.

use mapper_numerics::statistics::range;

/// A number, or a dash if there is none.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value
        .filter(|value| value.is_finite())
        .map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// A fraction in percent (for efficiencies: in points), or a dash.
pub fn percent(fraction: Option<f64>, decimals: usize) -> String {
    number(fraction.map(|fraction| 100.0 * fraction), decimals)
}

/// A number with at most this many significant digits, without trailing zeros.
pub fn significant_digits(value: f64, count: usize) -> String {
    let rounded: f64 = format!("{value:.*e}", count.saturating_sub(1)).parse().unwrap_or(value);
    if rounded != 0.0 && rounded.abs() < 1e-3 { format!("{rounded:e}") } else { rounded.to_string() }
}

/// `low to high` of values times a factor, or a dash without values.
pub(crate) fn range_text(values: impl Iterator<Item = f64>, factor: f64, digits: usize) -> String {
    let (low, high) = range(values);
    if low > high {
        number(None, digits)
    } else {
        format!("{:.digits$} to {:.digits$}", factor * low, factor * high)
    }
}

/// A number with four significant figures.
pub fn four_figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let exponent = value.abs().log10().floor();
    if !(-3.0..5.0).contains(&exponent) {
        return format!("{value:.3e}");
    }
    let decimals = (3.0 - exponent).max(0.0) as usize;
    format!("{value:.decimals$}")
}
