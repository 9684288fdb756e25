//! Parsing of a number and its unit, and such a value in a YAML file.

use crate::units::{Dimension, Kind, Unit};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};
use std::borrow::Cow;
use std::marker::PhantomData;

/// Reason why a text is not a quantity of the required kind.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum UnitError {
    #[error("`{text}` does not start with a number")]
    NoNumber { text: String },
    #[error("`{text}` has a decimal comma")]
    DecimalComma { text: String },
    #[error("`{text}` is not a finite number")]
    NotFinite { text: String },
    #[error("`{text}` has no unit")]
    NoUnit { text: String },
    #[error("`{unit}` is not a unit of {}", .kind.name())]
    WrongUnit { unit: String, kind: Kind },
}

impl UnitError {
    /// The remedy.
    pub fn remedy(&self, kind: Kind) -> String {
        let example = kind.example();
        let units = kind.unit_list();
        match self {
            UnitError::NoNumber { .. } | UnitError::NotFinite { .. } => {
                format!("write {} as a number and a unit, e.g. `{example}` (units: {units})", kind.name())
            }
            UnitError::DecimalComma { .. } => format!("write a decimal point, e.g. `{example}`"),
            UnitError::NoUnit { text } => {
                let number = text.trim();
                let share =
                    number.parse().ok().filter(|share: &f64| kind == Kind::Fraction && share.abs() < 1.0);
                match share.map(|share| 100.0 * share) {
                    Some(percent) => format!("write `{percent} %` for the share {number}, or `{number} %`"),
                    None => {
                        let probable = probable_unit(kind, number).unwrap_or_else(|| example.to_owned());
                        format!("write e.g. `{probable}` (units: {units})")
                    }
                }
            }
            UnitError::WrongUnit { unit, .. } => wrong_unit_remedy(unit, kind, &units),
        }
    }
}

/// A number without a unit, with the unit that makes it most similar to the example; `None` if no unit does.
fn probable_unit(kind: Kind, number: &str) -> Option<String> {
    let usual = parse(kind, kind.example()).ok()?;
    let candidates = kind.units().iter().filter_map(|unit| {
        let text = format!("{number} {}", unit.symbol());
        let decades = (parse(kind, &text).ok()? / usual).log10().abs();
        // Another quantity is more than thirty times larger or smaller.
        (decades < 1.5).then_some((decades, text))
    });
    candidates.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, text)| text)
}

fn wrong_unit_remedy(unit: &str, kind: Kind, units: &str) -> String {
    let lower = unit.to_lowercase();
    match kind {
        Kind::Pressure
            if ["psi", "psig", "barg", "bara", "bar(g)", "bar(a)", "kpag"].contains(&lower.as_str()) =>
        {
            format!("all pressures are absolute, and the unit must be unambiguous; write one of {units}")
        }
        Kind::TemperatureDifference if Kind::Temperature.unit(unit).is_some() => {
            format!("`{unit}` gives a temperature, not a difference of two; write one of {units}")
        }
        _ => {
            let differs_in_case = kind
                .units()
                .iter()
                .find(|candidate| candidate.spellings.iter().any(|s| s.to_lowercase() == lower))
                .map(|candidate| format!("did you mean `{}`? ", candidate.symbol()));
            format!("{}the units of {} are {units}", differs_in_case.unwrap_or_default(), kind.name())
        }
    }
}

/// Parses a number and its unit, e.g. `110 krpm`; the result is in SI units, except shaft speed in rpm.
///
/// Sign, decimal point and exponent are allowed; the blank before the unit may be missing.
///
/// # Errors
/// [`UnitError`], with its [`remedy`](UnitError::remedy).
pub fn parse(kind: Kind, text: &str) -> Result<f64, UnitError> {
    parse_with(kind, text, |spelling| kind.unit(spelling))
}

/// Like [`parse`], with the units that `unit_of` returns. The spelling of a bare number's unit is empty.
///
/// # Errors
/// The same as those of [`parse`].
pub fn parse_with(
    kind: Kind,
    text: &str,
    unit_of: impl FnOnce(&str) -> Option<&'static Unit>,
) -> Result<f64, UnitError> {
    let trimmed = text.trim();
    let (number, rest) = trimmed.split_at(number_length(trimmed));
    if number.is_empty() {
        return Err(UnitError::NoNumber { text: text.to_owned() });
    }
    if rest.starts_with(',') {
        return Err(UnitError::DecimalComma { text: text.to_owned() });
    }
    let value: f64 = number.parse().map_err(|_| UnitError::NoNumber { text: text.to_owned() })?;
    let unit = rest.trim();
    let found = unit_of(unit).ok_or_else(|| match unit {
        "" => UnitError::NoUnit { text: text.to_owned() },
        _ => UnitError::WrongUnit { unit: unit.to_owned(), kind },
    })?;
    let value = shift_decimal_point(number, found).unwrap_or_else(|| found.to_inside(value));
    if value.is_finite() { Ok(value) } else { Err(UnitError::NotFinite { text: text.to_owned() }) }
}

/// Converts a unit that differs from the SI unit by a power of ten only: `1.1 bar` becomes `1.1e5`, the `f64` nearest to the written
/// value.
fn shift_decimal_point(number: &str, unit: &Unit) -> Option<f64> {
    if unit.zero != 0.0 || unit.numerator != unit.denominator {
        return None;
    }
    let (mantissa, exponent) = number.split_once(['e', 'E']).unwrap_or((number, "0"));
    let exponent = exponent.parse::<i32>().ok()?.saturating_add(unit.decade);
    format!("{mantissa}e{exponent}").parse().ok()
}

/// Length in bytes of the number at the start of the text: `[+-]digits[.digits][e[+-]digits]`, at least one digit.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits_from = |start: usize| bytes.iter().skip(start).take_while(|b| b.is_ascii_digit()).count();
    let mut at = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let whole = digits_from(at);
    at += whole;
    let mut fraction = 0;
    if bytes.get(at) == Some(&b'.') {
        fraction = digits_from(at + 1);
        at += 1 + fraction;
    }
    if whole + fraction == 0 {
        return 0;
    }
    if matches!(bytes.get(at), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(at + 1), Some(b'+' | b'-')));
        let exponent = digits_from(at + 1 + sign);
        if exponent > 0 {
            at += 1 + sign + exponent;
        }
    }
    at
}

/// A value written with its unit, e.g. `110 krpm`.
///
/// In the schema it is a string with a pattern, an example and `x-quantity`, the kind's key. A field narrows its
/// range with `x-min`, `x-max` (both inclusive) and `x-above` (exclusive), written with units as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity<D> {
    /// The value in SI units, except shaft speed in rpm.
    pub value: f64,
    dimension: PhantomData<D>,
}

impl<D: Dimension> Quantity<D> {
    /// A quantity from its value in SI units, except shaft speed in rpm.
    pub fn new(value: f64) -> Self {
        Quantity { value, dimension: PhantomData }
    }
}

/// Overrides a default with the value of a file, if there is one.
pub fn set<T>(target: &mut T, given: Option<impl Into<T>>) {
    if let Some(given) = given {
        *target = given.into();
    }
}

impl<D> From<Quantity<D>> for f64 {
    /// The value in SI units, except shaft speed in rpm.
    fn from(quantity: Quantity<D>) -> f64 {
        quantity.value
    }
}

impl<D> From<Quantity<D>> for Option<f64> {
    fn from(quantity: Quantity<D>) -> Option<f64> {
        Some(quantity.value)
    }
}

impl<'de, D: Dimension> Deserialize<'de> for Quantity<D> {
    fn deserialize<S: Deserializer<'de>>(deserializer: S) -> Result<Self, S::Error> {
        let text = String::deserialize(deserializer)?;
        parse(D::KIND, &text)
            .map(Self::new)
            .map_err(|error| de::Error::custom(format!("{error}; {}", error.remedy(D::KIND))))
    }
}

impl<D: Dimension> JsonSchema for Quantity<D> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        D::KIND.key().into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "pattern": pattern(D::KIND),
            "examples": [D::KIND.example()],
            "x-quantity": D::KIND.key(),
        })
    }
}

/// A regular expression for editors; the parser decides.
fn pattern(kind: Kind) -> String {
    let units: Vec<String> =
        kind.units().iter().flat_map(|unit| unit.spellings).map(|spelling| escape(spelling)).collect();
    format!(r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*({})\s*$", units.join("|"))
}

fn escape(spelling: &str) -> String {
    let mut escaped = String::new();
    for c in spelling.chars() {
        match c {
            ' ' => escaped.push_str(r"\s+"),
            '^' | '*' | '(' | ')' | '/' => escaped.extend(['\\', c]),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_and_a_unit_give_exactly_the_literal() {
        let table = [
            (Kind::Temperature, "25 degC", 298.15),
            (Kind::Temperature, "500degC", 773.15),
            (Kind::Temperature, "-40 °C", 273.15 - 40.0),
            (Kind::Temperature, "298 K", 298.0),
            (Kind::TemperatureDifference, "0.25 K", 0.25),
            (Kind::TemperatureDifference, "100 mK", 0.1),
            (Kind::Pressure, "100 kPa", 100_000.0),
            (Kind::Pressure, "98.1 kPa", 98_100.0),
            (Kind::Pressure, "1.1 bar", 110_000.0),
            (Kind::Pressure, "13.95 psia", 13.95 * 0.45359237 * 9.80665 / 0.0254 / 0.0254),
            (Kind::Duration, "1e-99999999999 s", 0.0),
            (Kind::PressureDifference, "20 Pa", 20.0),
            (Kind::Speed, "110 krpm", 110_000.0),
            (Kind::Speed, "110e3 rpm", 110_000.0),
            (Kind::Speed, "50000 1/min", 50_000.0),
            (Kind::Speed, "1000 Hz", 60_000.0),
            (Kind::MassFlow, "1.5e-4 kg/s", 1.5e-4),
            (Kind::MassFlow, "36 kg/h", 0.01),
            (Kind::MassFlow, "60 g/s", 0.06),
            (Kind::Duration, "10 min", 600.0),
            (Kind::Duration, "+.5 h", 1800.0),
            (Kind::Duration, "300 ms", 0.3),
            (Kind::Length, "35 mm", 35e-3),
            (Kind::Length, "52 mm", 52e-3),
            (Kind::Length, "23.5 mm", 0.0235),
            (Kind::Length, "1 in", 0.0254),
            (Kind::Area, "29e-3 m^2", 29e-3),
            (Kind::Area, "290 cm²", 29e-3),
            (Kind::Volume, "0.78 L", 0.78e-3),
            (Kind::Mass, "930 g", 0.93),
            (Kind::Inertia, "16e-6 kg m^2", 16e-6),
            (Kind::Inertia, "16  kg   mm^2", 16e-6),
            (Kind::Conductance, "8 W/K", 8.0),
            (Kind::Conductivity, "47.5 W/(m K)", 47.5),
            (Kind::Fraction, "0.5 %", 0.005),
            (Kind::Fraction, "50%", 0.5),
        ];
        for (kind, text, inside) in table {
            assert_eq!(parse(kind, text), Ok(inside), "{text}");
        }
    }

    #[test]
    fn what_is_no_quantity_is_refused_with_its_remedy() {
        let table = [
            (Kind::Duration, "10", "`10` has no unit", "write e.g. `10 s` (units: s, ms, min, h)"),
            (Kind::Duration, "ten s", "does not start with a number", "e.g. `10 s`"),
            (Kind::Duration, "", "does not start with a number", "e.g. `10 s`"),
            (Kind::Duration, ".", "does not start with a number", "e.g. `10 s`"),
            (Kind::Duration, "0,5 s", "decimal comma", "write a decimal point, e.g. `10 s`"),
            (Kind::Duration, "10 K", "`K` is not a unit of a time", "the units of a time are s, ms, min, h"),
            (Kind::Duration, "1e999 s", "not a finite number", "e.g. `10 s`"),
            (Kind::Duration, "NaN s", "does not start with a number", "e.g. `10 s`"),
            (Kind::Speed, "110 kRPM", "`kRPM` is not a unit of a shaft speed", "did you mean `krpm`?"),
            (Kind::Speed, "1_000 rpm", "`_000 rpm` is not a unit", "the units of a shaft speed are rpm"),
            (
                Kind::Pressure,
                "14 psi",
                "`psi` is not a unit of an absolute pressure",
                "all pressures are absolute",
            ),
            (Kind::Pressure, "1 barg", "`barg` is not a unit", "all pressures are absolute"),
            (
                Kind::TemperatureDifference,
                "0.25 degC",
                "`degC` is not a unit",
                "not a difference of two; write one of K",
            ),
            (Kind::Temperature, "20 C", "`C` is not a unit of a temperature", "K, degC, degF, degR"),
        ];
        for (kind, text, message, remedy) in table {
            let error = parse(kind, text).unwrap_err();
            assert!(error.to_string().contains(message), "{text}: {error}");
            assert!(error.remedy(kind).contains(remedy), "{text}: {}", error.remedy(kind));
        }
    }

    proptest::proptest! {
        #[test]
        fn any_text_gives_an_answer_and_never_a_value_that_is_not_finite(text in ".{0,40}", index in 0..Kind::ALL.len()) {
            if let Ok(value) = parse(Kind::ALL[index], &text) {
                proptest::prop_assert!(value.is_finite());
            }
        }

        #[test]
        fn a_written_number_is_read_back_exactly(value in -1e30f64..1e30) {
            proptest::prop_assert_eq!(parse(Kind::Duration, &format!("{value:e} s")), Ok(value));
        }
    }
}
