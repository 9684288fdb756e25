//! Tag numbers of piping diagrams (ISA 5.1): `TT-101`, `PT_2101`, `FT-3`.

use super::measured::Measured;

/// Tags with another meaning if their number is short: `PT2` is the total pressure at station 2, `TIT 1` a turbine inlet temperature.
const LONG_NUMBERS: [&str; 6] = ["tt", "pt", "pi", "pit", "tit", "st"];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tag {
    pub(super) measured: Measured,
    /// The number of its loop.
    pub(super) number: u32,
}

/// The tag number at the start of a name, and the rest of the name.
pub(super) fn split_tag(name: &str) -> Option<(Tag, &str)> {
    let letters = name.find(|c: char| !c.is_ascii_alphabetic())?;
    let (code, rest) = name.split_at(letters);
    let code = code.to_ascii_lowercase();
    let mut functions = code.chars();
    // `PT100` is a resistance thermometer, `PT-100` a tag.
    let is_thermometer = code == "pt" && ["100", "500", "1000"].iter().any(|ohms| rest.starts_with(ohms));
    let measured = match functions.next()? {
        'p' if is_thermometer => Measured::Temperature,
        't' => Measured::Temperature,
        'p' => Measured::Pressure,
        'f' => Measured::Flow,
        's' => Measured::Speed,
        _ => return None,
    };
    // Transmitter, element, indicator, recorder; `D` is a difference, `V` a valve.
    if !(1..=2).contains(&functions.as_str().len()) || !functions.all(|letter| "teir".contains(letter)) {
        return None;
    }
    let number = rest.trim_start_matches(['-', '_', ' ', '.']);
    let digits = number.find(|c: char| !c.is_ascii_digit()).unwrap_or(number.len());
    let suffix = number[digits..].trim_start_matches(|c: char| c.is_ascii_uppercase());
    let ends = suffix.is_empty() || suffix.starts_with(|c: char| !c.is_alphanumeric());
    let least = if LONG_NUMBERS.contains(&code.as_str()) { 3 } else { 1 };
    let loop_number = number[..digits].parse().ok()?;
    (ends && (least..=5).contains(&digits)).then_some((Tag { measured, number: loop_number }, suffix))
}
