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

/// Length above which a decimal number is written with a power of ten, characters: a double in full has 17 digits.
const MAX_PLAIN_LENGTH: usize = 40;

/// Replaces decimal numbers that are too long to read, such as 1e300 in full, by the same with a power of ten.
pub fn shorten_numbers(text: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let (mut short, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(start) = rest.find(is_part) {
        let (before, from) = rest.split_at(start);
        let (run, after) = from.split_at(from.find(|c| !is_part(c)).unwrap_or(from.len()));
        short.push_str(before);
        let number = run.trim_end_matches('.');
        // Digits within a word are a hash.
        let is_word = short.ends_with(char::is_alphanumeric) || after.starts_with(char::is_alphanumeric);
        match number.parse::<f64>() {
            Ok(value) if number.len() > MAX_PLAIN_LENGTH && value.is_finite() && !is_word => {
                short += &format!("{value:e}{}", run.split_at(number.len()).1);
            }
            _ => short.push_str(run),
        }
        rest = after;
    }
    short + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_long_numbers_have_a_power_of_ten() {
        let (large, small, hash) = (1e300, 2.5e-300, "4".repeat(64));
        let text = format!("from -{large:.1} s to {large} s. Not {small}, 1.25 of 3 or {hash}f.");
        assert_eq!(
            shorten_numbers(&text),
            format!("from -1e300 s to 1e300 s. Not 2.5e-300, 1.25 of 3 or {hash}f.")
        );
    }

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
