//! A number with its unit, as people write it.

use std::fmt::Display;

/// `value` followed by `unit`; a ratio, whose unit is `1` or empty, stands alone: "1.04", not "1.04 1".
pub fn with_unit(value: impl Display, unit: &str) -> String {
    match unit {
        "" | "1" => value.to_string(),
        unit => format!("{value} {unit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_stand_without_a_unit() {
        assert_eq!(with_unit(1.04, "1"), "1.04");
        assert_eq!(with_unit(1.04, ""), "1.04");
        assert_eq!(with_unit(0.25, "K"), "0.25 K");
    }
}
