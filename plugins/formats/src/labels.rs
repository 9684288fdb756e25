//! Numbers as text.

use mapper_core::MapUnits;

/// The shortest text that reads back to the same number.
pub(crate) fn number(value: f64) -> String {
    value.to_string()
}

/// As [`number`]; empty for none.
pub(crate) fn digits(value: Option<f64>) -> String {
    value.map(number).unwrap_or_default()
}

/// A speed in the displayed unit, without needless digits.
pub(crate) fn speed(speed_rpm: f64, units: &MapUnits) -> String {
    label(speed_rpm * units.speed_of_one_rpm)
}

/// Text of an efficiency (fraction) in %, without needless digits.
pub(crate) fn percent(eta: f64) -> String {
    label(100.0 * eta)
}

fn label(value: f64) -> String {
    let text = format!("{value:.1}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
