//! Numbers as text. Zero never carries a sign, so that equal results give equal bytes.

/// `value` with `decimals` digits after the point; `-0.0` is `0.0`, NaN is `-`.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        _ => text,
    }
}

/// As [`fixed`], with a plus sign for positive values.
pub(crate) fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let zero = text.chars().all(|c| c == '0' || c == '.' || c == '-');
    if zero || text.starts_with('-') { text } else { format!("+{text}") }
}

/// As [`signed`]; `-` for a missing value.
pub(crate) fn signed_or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| signed(value, decimals))
}

/// `low to high` with signs.
pub(crate) fn range(range: Option<(f64, f64)>, decimals: usize) -> String {
    match range {
        Some((low, high)) => format!("{} to {}", signed(low, decimals), signed(high, decimals)),
        None => "none".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign() {
        assert_eq!([fixed(-0.001, 2), signed(0.001, 2), signed(1.5, 1)], ["0.00", "0.00", "+1.5"]);
        assert_eq!([signed(-1.25, 2), fixed(f64::NAN, 2), signed_or_dash(None, 1)], ["-1.25", "-", "-"]);
    }
}
