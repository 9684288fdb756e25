//! A probability as text.

/// A probability in whole per cent. It is not more certain than its assumptions: outside 0.5 to 99.5 % only the limit is given.
pub fn probability_text(probability: f64) -> String {
    match 100.0 * probability {
        percent if percent > 99.5 => ">99.5 %".to_owned(),
        percent if percent < 0.5 => "<0.5 %".to_owned(),
        percent => format!("{percent:.0} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::probability_text;

    #[test]
    fn no_probability_is_certain() {
        for (probability, text) in [
            (1.0, ">99.5 %"),
            (0.996, ">99.5 %"),
            (0.994, "99 %"),
            (0.5, "50 %"),
            (0.006, "1 %"),
            (0.0, "<0.5 %"),
        ] {
            assert_eq!(probability_text(probability), text);
        }
    }
}
