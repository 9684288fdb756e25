//! Numbers as text labels of the picture.

use mapper_core::MapUnits;

/// A speed in the displayed unit, without needless digits.
pub(crate) fn speed(speed_rpm: f64, units: &MapUnits) -> String {
    let text = format!("{:.1}", speed_rpm * units.speed_of_one_rpm);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// Text of an efficiency (fraction) in %, without needless digits.
pub(crate) fn percent(eta: f64) -> String {
    let text = format!("{:.1}", 100.0 * eta);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
