//! Numbers as they stand in the picture.

/// A speed in krpm without needless digits.
pub(crate) fn krpm(speed_rpm: f64) -> String {
    let text = format!("{:.1}", speed_rpm / 1000.0);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// Text of an efficiency (fraction) in %, without needless digits.
pub(crate) fn percent(eta: f64) -> String {
    let text = format!("{:.1}", 100.0 * eta);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
