//! A number with its unit, as people write it.

use std::fmt::Display;

/// `value` followed by `unit`; a ratio, whose unit is `1` or empty, has no unit: "1.04", not "1.04 1".
pub fn with_unit(value: impl Display, unit: &str) -> String {
    match unit {
        "" | "1" => value.to_string(),
        unit => format!("{value} {unit}"),
    }
}

/// A temperature in the form of limits and files: `300.0 degC (573.2 K)`.
pub fn temperature(value_k: f64) -> String {
    format!("{:.1} degC ({value_k:.1} K)", value_k - 273.15)
}

/// Size above which a value is written with a power of ten: far above every reading.
const MAX_PLAIN: f64 = 1e9;

/// A reading in the form of limits: temperatures as [`temperature`], pressures in kPa, speeds in krpm; others in `unit`.
pub fn readable(value: f64, unit: &str) -> String {
    match unit {
        _ if value.abs() >= MAX_PLAIN => with_unit(format!("{value:.3e}"), unit),
        "K" => temperature(value),
        "Pa" => format!("{:.1} kPa", value / 1e3),
        "rpm" => format!("{:.2} krpm", value / 1e3),
        unit => with_unit(format!("{value:.1}"), unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_have_the_units_of_limits() {
        assert_eq!(readable(573.15, "K"), "300.0 degC (573.1 K)");
        assert_eq!(readable(512_345.0, "Pa"), "512.3 kPa");
        assert_eq!(readable(155e3, "rpm"), "155.00 krpm");
        assert_eq!(readable(1e300, "Pa"), "1.000e300 Pa");
    }

    #[test]
    fn ratios_stand_without_a_unit() {
        assert_eq!(with_unit(1.04, "1"), "1.04");
        assert_eq!(with_unit(1.04, ""), "1.04");
        assert_eq!(with_unit(0.25, "K"), "0.25 K");
    }
}
