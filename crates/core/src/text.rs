//! Text for people: numbers with units, lines for terminals.

use crate::unit_factors::{ICE_POINT_K, PA_PER_KPA, PERCENT, RPM_PER_KRPM};
use std::fmt::{Display, Write};
use std::hash::{BuildHasher, RandomState};
use std::sync::LazyLock;

/// Replaces control characters and line separators by blanks, so that a name cannot end a comment.
pub fn one_line(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') { ' ' } else { c })
        .collect()
}

/// Smallest probability that is shown, per cent. Bound: less than one that rounds to a whole per cent.
const SHOWN_PERCENT: f64 = 0.5;

/// A probability in whole per cent. It is not more certain than its assumptions: outside 0.5 to 99.5 % only the limit is given.
pub fn probability_text(probability: f64) -> String {
    match PERCENT * probability {
        percent if percent > PERCENT - SHOWN_PERCENT => ">99.5 %".to_owned(),
        percent if percent < SHOWN_PERCENT => "<0.5 %".to_owned(),
        percent => format!("{percent:.0} %"),
    }
}

/// Represents the escape character in our own text until [`terminal_text`] replaces it. Foreign text cannot contain it, because it differs in
/// each process.
static OWN_ESCAPE: LazyLock<String> =
    LazyLock::new(|| format!("\u{fdd0}{:016x}", RandomState::new().hash_one(0)));

/// Text in a colour of the terminal (SGR code) once it has passed [`terminal_text`].
pub fn coloured_text(text: &str, code: u8) -> String {
    let escape = OWN_ESCAPE.as_str();
    format!("{escape}[{code}m{text}{escape}[0m")
}

/// Whether a terminal interprets this character: control characters except line ends and tabs, and marks for right-to-left text.
fn is_interpreted(c: char) -> bool {
    c.is_control() && !matches!(c, '\n' | '\t')
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Replaces characters that a terminal interprets, except the colours of [`coloured_text`]. Names of files, channels and units, and
/// messages of drivers, are foreign text and could otherwise control the terminal or hide text.
pub fn terminal_text(text: &str) -> String {
    let safe = text.replace("\r\n", "\n").replace(is_interpreted, "\u{fffd}");
    shorten_numbers(&safe).replace(OWN_ESCAPE.as_str(), "\u{1b}")
}

/// The same JSON without characters that a terminal interprets: JSON itself escapes only those below U+0020.
pub fn terminal_json(json: &str) -> String {
    let mut safe = String::with_capacity(json.len());
    for c in json.chars() {
        // A string takes every fragment.
        let _ = if is_interpreted(c) { write!(safe, "\\u{:04x}", u32::from(c)) } else { safe.write_char(c) };
    }
    safe
}

/// `value` followed by `unit`; a ratio, whose unit is `1` or empty, has no unit: "1.04", not "1.04 1".
pub fn with_unit(value: impl Display, unit: &str) -> String {
    match unit {
        "" | "1" => value.to_string(),
        unit => format!("{value} {unit}"),
    }
}

/// A temperature in the form of limits and files: `300.0 degC (573.2 K)`.
pub fn temperature(value_k: f64) -> String {
    format!("{:.1} degC ({value_k:.1} K)", value_k - ICE_POINT_K)
}

/// Parts of a krpm that are shown. Bound: a tenth of what a speed control holds.
const SHOWN_PER_KRPM: f64 = 100.0;

/// A speed for display: in krpm, to 0.01.
pub fn krpm(speed_rpm: f64) -> f64 {
    (SHOWN_PER_KRPM * speed_rpm / RPM_PER_KRPM).round() / SHOWN_PER_KRPM
}

/// Size above which a value is written with a power of ten. Bound: far above every reading.
const MAX_PLAIN: f64 = 1e9;

/// A reading in the form of limits: temperatures as [`temperature`], pressures in kPa, speeds in krpm; others in `unit`.
pub fn readable(value: f64, unit: &str) -> String {
    match unit {
        _ if value.abs() >= MAX_PLAIN => with_unit(format!("{value:.3e}"), unit),
        "K" => temperature(value),
        "Pa" => format!("{:.1} kPa", value / PA_PER_KPA),
        "rpm" => format!("{:.2} krpm", value / RPM_PER_KRPM),
        unit => with_unit(format!("{value:.1}"), unit),
    }
}

/// Length above which a decimal number is written with a power of ten, characters. Bound: a double in full has 17 digits.
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
    use crate::one_line;

    #[test]
    fn no_line_ends_within() {
        assert_eq!(one_line("a\nb\u{2028}c\rd"), "a b c d");
    }

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

    #[test]
    fn only_our_own_colours_reach_the_terminal() {
        for (text, safe) in [
            ("p2 in kPa\n\tgood", "p2 in kPa\n\tgood"),
            // A colour, title, cleared screen, hidden text, a carriage return, a backspace, C1, a name that reads backwards.
            ("\u{1b}[1;31mred\u{1b}[0m", "\u{fffd}[1;31mred\u{fffd}[0m"),
            ("\u{1b}]0;x\u{7}", "\u{fffd}]0;x\u{fffd}"),
            ("\u{1b}[2J", "\u{fffd}[2J"),
            ("\u{1b}[8mhidden", "\u{fffd}[8mhidden"),
            ("good\rbad", "good\u{fffd}bad"),
            ("good\r\nbad\r", "good\nbad\u{fffd}"),
            ("a\u{8}b\u{9b}c", "a\u{fffd}b\u{fffd}c"),
            ("x\u{202e}lmay", "x\u{fffd}lmay"),
        ] {
            assert_eq!(terminal_text(text), safe);
        }
        assert_eq!(terminal_text(&coloured_text("good", 32)), "\u{1b}[32mgood\u{1b}[0m");
    }

    #[test]
    fn json_keeps_its_meaning() {
        let name = "a\u{1b}[31m\u{9b}2J\u{202e}\u{7f} °\n";
        let json = terminal_json(&serde_json::to_string_pretty(&[name]).unwrap());
        assert!(!json.contains(is_interpreted), "{json}");
        assert_eq!(serde_json::from_str::<Vec<String>>(&json).unwrap(), [name]);
    }

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
