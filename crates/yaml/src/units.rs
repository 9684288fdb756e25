//! Units of values: kinds and their notation.
//!
//! Decimal prefixes are added to the written exponent, so that `1.1 bar` is the `f64` nearest to 110000 and
//! `52 mm` equals `52e-3`; the few other factors are exact definitions. A library for units multiplies by a rounded
//! factor, has no name for `krpm`, and parses only its own spellings; this table is short enough to check against
//! the definitions of the units.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};
use std::borrow::Cow;
use std::marker::PhantomData;

/// A unit. Conversion to the internal unit (SI, except rpm for shaft speed): `(value + zero) * numerator / denominator * 10^decade`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Spellings; the first is the one shown to people.
    pub spellings: &'static [&'static str],
    /// Offset that is added to a written value before scaling; 0 except for degC and degF.
    pub zero: f64,
    /// Numerator of the exact factor.
    pub numerator: f64,
    /// Denominator of the exact factor.
    pub denominator: f64,
    /// Decimal part of the factor; the parser adds it to the written exponent, so that it costs no rounding.
    pub decade: i32,
}

impl Unit {
    /// The spelling shown to people.
    pub fn symbol(&self) -> &'static str {
        self.spellings.first().copied().unwrap_or_default()
    }

    /// Converts a value from this unit to the internal unit (SI, except rpm for shaft speed).
    pub fn to_inside(&self, value: f64) -> f64 {
        // Adding 0 would turn -0 into 0; values in the internal unit must not change at all.
        let shifted = if self.zero == 0.0 { value } else { value + self.zero };
        let scaled = shifted * self.numerator / self.denominator;
        if self.decade < 0 { scaled / 10f64.powi(-self.decade) } else { scaled * 10f64.powi(self.decade) }
    }

    /// Whether both units have the same size, e.g. `mbar` and `hPa`.
    pub fn converts_like(&self, other: &Unit) -> bool {
        let factors = |unit: &Unit| (unit.zero, unit.numerator, unit.denominator, unit.decade);
        factors(self) == factors(other)
    }

    /// Converts a value from the internal unit to this unit.
    pub fn from_inside(&self, inside: f64) -> f64 {
        let scaled = if self.decade < 0 {
            inside * 10f64.powi(-self.decade)
        } else {
            inside / 10f64.powi(self.decade)
        };
        scaled * self.denominator / self.numerator - self.zero
    }
}

const fn unit(spellings: &'static [&'static str], numerator: f64, denominator: f64) -> Unit {
    Unit { spellings, zero: 0.0, numerator, denominator, decade: 0 }
}

const fn decimal(spellings: &'static [&'static str], decade: i32) -> Unit {
    Unit { spellings, zero: 0.0, numerator: 1.0, denominator: 1.0, decade }
}

/// A share written as a bare number.
pub const BARE_RATIO: Unit =
    Unit { spellings: &["1", "-"], zero: 0.0, numerator: 1.0, denominator: 1.0, decade: 0 };

const TEMPERATURE: &[Unit] = &[
    decimal(&["K"], 0),
    Unit { spellings: &["degC", "°C", "℃"], zero: 273.15, numerator: 1.0, denominator: 1.0, decade: 0 },
    Unit { spellings: &["degF", "°F"], zero: 459.67, numerator: 5.0, denominator: 9.0, decade: 0 },
    unit(&["degR", "°R"], 5.0, 9.0),
];
const TEMPERATURE_DIFFERENCE: &[Unit] = &[decimal(&["K"], 0), decimal(&["mK"], -3)];
// psi = lb * g / in^2 = 0.45359237 * 9.80665 / 0.0254^2 Pa.
const PSI_NUMERATOR: f64 = 4.448_221_615_260_5;
const PSI_DENOMINATOR: f64 = 0.000_645_16;
const PRESSURE: &[Unit] = &[
    decimal(&["Pa"], 0),
    decimal(&["kPa"], 3),
    decimal(&["hPa"], 2),
    decimal(&["MPa"], 6),
    decimal(&["bar"], 5),
    decimal(&["mbar"], 2),
    unit(&["atm"], 101_325.0, 1.0),
    unit(&["psia", "lbf/in2", "lbf/in^2"], PSI_NUMERATOR, PSI_DENOMINATOR),
    unit(&["kgf/cm2", "kgf/cm^2", "kgf/cm²"], 98_066.5, 1.0),
    unit(&["mmHg"], MMHG_PA, 1.0),
    // 760 Torr are one atmosphere.
    unit(&["Torr"], 101_325.0, 760.0),
    unit(&["inHg"], 25.4 * MMHG_PA, 1.0),
    unit(&["mmH2O", "mmWS", "mmWC", "mmCA"], 9.806_65, 1.0),
    unit(&["inH2O", "inWC"], 25.4 * 9.806_65, 1.0),
];
/// Conventional millimetre of mercury, 13595.1 kg/m3 at standard gravity (NIST SP 811, B.8), Pa.
const MMHG_PA: f64 = 13.595_1 * 9.806_65;
const PRESSURE_DIFFERENCE: &[Unit] = &[
    decimal(&["Pa"], 0),
    decimal(&["kPa"], 3),
    decimal(&["hPa"], 2),
    decimal(&["bar"], 5),
    decimal(&["mbar"], 2),
    unit(&["psi"], PSI_NUMERATOR, PSI_DENOMINATOR),
];
const SPEED: &[Unit] = &[
    decimal(&["rpm", "1/min", "min^-1", "rev/min"], 0),
    decimal(&["krpm"], 3),
    unit(&["Hz", "1/s", "rev/s"], 60.0, 1.0),
    unit(&["rad/s"], 30.0, std::f64::consts::PI),
];
const MASS_FLOW: &[Unit] = &[
    decimal(&["kg/s"], 0),
    decimal(&["g/s"], -3),
    unit(&["kg/min"], 1.0, 60.0),
    unit(&["kg/h", "kg/hr"], 1.0, 3600.0),
    unit(&["lb/s"], 0.453_592_37, 1.0),
    unit(&["lb/min"], 0.453_592_37, 60.0),
    decimal(&["mg/s"], -6),
    unit(&["lb/h", "lb/hr"], 0.453_592_37, 3600.0),
    unit(&["t/h"], 1000.0, 3600.0),
    // Volumes of dry air under standard conditions are masses once the temperature is named.
    unit(&["SCFM(0degC)"], CUBIC_FOOT_M3 * AIR_AT_1_K, 60.0 * 273.15),
    unit(&["SCFM(15degC)"], CUBIC_FOOT_M3 * AIR_AT_1_K, 60.0 * 288.15),
    unit(&["SCFM(60degF)"], CUBIC_FOOT_M3 * AIR_AT_1_K, 60.0 * 519.67 / 1.8),
    unit(&["SCFM(20degC)"], CUBIC_FOOT_M3 * AIR_AT_1_K, 60.0 * 293.15),
    unit(&["SCFM(70degF)"], CUBIC_FOOT_M3 * AIR_AT_1_K, 60.0 * 529.67 / 1.8),
    unit(&["SLPM(0degC)"], 1e-3 * AIR_AT_1_K, 60.0 * 273.15),
    unit(&["SLPM(20degC)"], 1e-3 * AIR_AT_1_K, 60.0 * 293.15),
    unit(&["Nm3/h", "Nm³/h"], AIR_AT_1_K, 3600.0 * 273.15),
    unit(&["Sm3/h", "Sm³/h"], AIR_AT_1_K, 3600.0 * 288.15),
];
/// A cubic foot, m3.
pub const CUBIC_FOOT_M3: f64 = 0.3048 * 0.3048 * 0.3048;
/// Density of dry air at 101.325 kPa times its temperature, kg K/m3; gas constant of the standard atmosphere (ISO 2533).
const AIR_AT_1_K: f64 = 101_325.0 / 287.052_87;
const DURATION: &[Unit] =
    &[decimal(&["s"], 0), decimal(&["ms"], -3), unit(&["min"], 60.0, 1.0), unit(&["h"], 3600.0, 1.0)];
const LENGTH: &[Unit] = &[
    decimal(&["m"], 0),
    decimal(&["mm"], -3),
    decimal(&["cm"], -2),
    decimal(&["um", "µm", "μm"], -6),
    unit(&["in"], 0.0254, 1.0),
];
const AREA: &[Unit] = &[
    decimal(&["m^2", "m2", "m²"], 0),
    decimal(&["cm^2", "cm2", "cm²"], -4),
    decimal(&["mm^2", "mm2", "mm²"], -6),
];
const VOLUME: &[Unit] =
    &[decimal(&["m^3", "m3", "m³"], 0), decimal(&["cm^3", "cm3", "cm³"], -6), decimal(&["L", "l"], -3)];
const MASS: &[Unit] = &[decimal(&["kg"], 0), decimal(&["g"], -3), unit(&["lb"], 0.453_592_37, 1.0)];
const INERTIA: &[Unit] = &[
    decimal(&["kg m^2", "kg m2", "kg m²", "kg*m^2"], 0),
    decimal(&["kg mm^2", "kg mm2", "kg mm²", "kg*mm^2"], -6),
    decimal(&["g cm^2", "g cm2", "g cm²", "g*cm^2"], -7),
];
const CONDUCTANCE: &[Unit] = &[decimal(&["W/K"], 0)];
const POWER: &[Unit] = &[decimal(&["W"], 0), decimal(&["kW"], 3)];
const CONDUCTIVITY: &[Unit] = &[decimal(&["W/(m K)", "W/(m*K)", "W/m/K", "W/(K m)"], 0)];
const FRACTION: &[Unit] = &[decimal(&["%"], -2), decimal(&["ppm"], -6)];
const FREQUENCY: &[Unit] = &[decimal(&["Hz", "1/s"], 0), decimal(&["kHz"], 3)];
const PRESSURE_RATE: &[Unit] = &[decimal(&["Pa/s"], 0), decimal(&["kPa/s"], 3), decimal(&["bar/s"], 5)];
const TEMPERATURE_RATE: &[Unit] = &[decimal(&["K/s"], 0), unit(&["K/min"], 1.0, 60.0)];
const RATIO_RATE: &[Unit] = &[decimal(&["1/s"], 0), decimal(&["%/s"], -2)];

/// A type that stands for a kind of quantity.
pub trait Dimension {
    /// The kind.
    const KIND: Kind;
}

/// Declares the kinds: for each its type, its key, its name with the article, a value as one would write it, and its units.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident $key:literal, $named:literal, $example:literal, $units:ident;)*) => {
        /// Kind of a quantity.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Kind {
            $($(#[$doc])* $name,)*
        }

        $(
            $(#[$doc])*
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub enum $name {}
            impl Dimension for $name {
                const KIND: Kind = Kind::$name;
            }
        )*

        impl Kind {
            /// All kinds.
            pub const ALL: [Kind; [$($key),*].len()] = [$(Kind::$name),*];

            /// Stable key, as in the schema's `x-quantity`.
            pub fn key(self) -> &'static str {
                match self { $(Kind::$name => $key,)* }
            }

            /// Name with its article, for messages.
            pub fn name(self) -> &'static str {
                match self { $(Kind::$name => $named,)* }
            }

            /// A value as one would write it.
            pub fn example(self) -> &'static str {
                match self { $(Kind::$name => $example,)* }
            }

            /// The allowed units; the first is the internal unit, except for fractions.
            pub fn units(self) -> &'static [Unit] {
                match self { $(Kind::$name => $units,)* }
            }
        }
    };
}

kinds! {
    /// Absolute temperature; stored in K.
    Temperature "temperature", "a temperature", "25 degC", TEMPERATURE;
    /// Difference of temperatures (noise, offset); stored in K.
    TemperatureDifference "temperature_difference", "a temperature difference", "0.25 K", TEMPERATURE_DIFFERENCE;
    /// Absolute pressure; stored in Pa.
    Pressure "pressure", "an absolute pressure", "100 kPa", PRESSURE;
    /// Difference of pressures (noise, offset); stored in Pa.
    PressureDifference "pressure_difference", "a pressure difference", "50 Pa", PRESSURE_DIFFERENCE;
    /// Shaft speed; stored in rpm.
    Speed "speed", "a shaft speed", "110 krpm", SPEED;
    /// Mass flow; stored in kg/s.
    MassFlow "mass_flow", "a mass flow", "1.5e-4 kg/s", MASS_FLOW;
    /// Time; stored in s.
    Duration "duration", "a time", "10 s", DURATION;
    /// Length; stored in m.
    Length "length", "a length", "35 mm", LENGTH;
    /// Area; stored in m2.
    Area "area", "an area", "29e-3 m^2", AREA;
    /// Volume; stored in m3.
    Volume "volume", "a volume", "0.78e-3 m^3", VOLUME;
    /// Mass; stored in kg.
    Mass "mass", "a mass", "0.93 kg", MASS;
    /// Moment of inertia; stored in kg m2.
    Inertia "inertia", "a moment of inertia", "16e-6 kg m^2", INERTIA;
    /// Thermal conductance; stored in W/K.
    Conductance "conductance", "a thermal conductance", "8 W/K", CONDUCTANCE;
    /// Power; stored in W.
    Power "power", "a power", "440 W", POWER;
    /// Thermal conductivity; stored in W/(m K).
    Conductivity "conductivity", "a thermal conductivity", "47.5 W/(m K)", CONDUCTIVITY;
    /// Share of a whole; stored as a ratio.
    Fraction "fraction", "a share", "0.5 %", FRACTION;
    /// Frequency; stored in Hz.
    Frequency "frequency", "a frequency", "10 Hz", FREQUENCY;
    /// Rate of a pressure; stored in Pa/s.
    PressureRate "pressure_rate", "a rate of pressure", "100 kPa/s", PRESSURE_RATE;
    /// Rate of a temperature; stored in K/s.
    TemperatureRate "temperature_rate", "a rate of temperature", "5 K/s", TEMPERATURE_RATE;
    /// Rate of a ratio such as a valve opening; stored in 1/s.
    RatioRate "ratio_rate", "a rate of opening", "1 1/s", RATIO_RATE;
}

impl Kind {
    /// The kind with that key.
    pub fn from_key(key: &str) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| kind.key() == key)
    }

    /// The unit with that spelling. Runs of blanks count as one.
    pub fn unit(self, spelling: &str) -> Option<&'static Unit> {
        let spelling = spelling.split_whitespace().collect::<Vec<_>>().join(" ");
        self.units().iter().find(|unit| unit.spellings.contains(&spelling.as_str()))
    }

    /// The symbols of all units, for messages.
    pub fn unit_list(self) -> String {
        self.units().iter().map(Unit::symbol).collect::<Vec<_>>().join(", ")
    }
}

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
pub fn parse(kind: Kind, text: &str) -> Result<f64, UnitError> {
    parse_with(kind, text, |spelling| kind.unit(spelling))
}

/// Like [`parse`], with the units that `unit_of` returns. The spelling of a bare number's unit is empty.
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
    fn keys_and_spellings_are_unambiguous_and_examples_parse() {
        for kind in Kind::ALL {
            assert_eq!(Kind::from_key(kind.key()), Some(kind));
            assert!(parse(kind, kind.example()).is_ok(), "{}", kind.example());
            let spellings: Vec<_> = kind.units().iter().flat_map(|unit| unit.spellings).collect();
            let distinct: std::collections::BTreeSet<_> = spellings.iter().collect();
            assert_eq!(spellings.len(), distinct.len(), "{kind:?}");
        }
    }

    #[test]
    fn conversion_to_a_unit_and_back_is_the_identity() {
        for unit in Kind::ALL.iter().flat_map(|kind| kind.units()) {
            for value in [0.0, 1.0, 13.95, 545.0] {
                // Three roundings each way; degF adds 460 to a value near 0.
                assert!((unit.from_inside(unit.to_inside(value)) - value).abs() < 1e-12 * (500.0 + value));
            }
        }
    }

    #[test]
    fn the_unit_used_inside_leaves_every_bit_as_it_is() {
        for unit in Kind::ALL.iter().flat_map(|kind| kind.units()) {
            if unit.converts_like(&decimal(&[], 0)) {
                for value in [-0.0, 0.1, 98_100.123_456_789, 5e-324, f64::MAX] {
                    assert_eq!(unit.to_inside(value).to_bits(), value.to_bits(), "{} {value}", unit.symbol());
                }
            }
        }
    }

    #[test]
    fn factors_agree_with_the_definitions_of_the_units() {
        // NIST SP 811, appendix B.8, as printed there (6 or 7 digits, hence the tolerance).
        let printed = [
            (Kind::Pressure, "psia", 6_894.757),
            (Kind::Pressure, "atm", 101_325.0),
            (Kind::Pressure, "kgf/cm2", 98_066.5),
            (Kind::Pressure, "mmHg", 133.322_4),
            (Kind::Pressure, "Torr", 133.322_4),
            (Kind::Pressure, "inHg", 3_386.389),
            (Kind::Pressure, "mmH2O", 9.806_65),
            (Kind::Pressure, "inH2O", 249.088_9),
            (Kind::MassFlow, "lb/h", 1.259_979e-4),
            (Kind::MassFlow, "lb/min", 7.559_873e-3),
            (Kind::Length, "in", 2.54e-2),
            (Kind::Mass, "lb", 4.535_924e-1),
            (Kind::Speed, "rad/s", 1.0 / 1.047_198e-1),
        ];
        for (kind, symbol, factor) in printed {
            let ours = kind.unit(symbol).unwrap().to_inside(1.0);
            assert!((ours / factor - 1.0).abs() < 5e-7, "{symbol}: {ours} against {factor}");
        }
        // Density of dry air at 101.325 kPa: 1.2922 kg/m3 at 0 degC, 1.2250 at 15 degC (ISO 2533), 1.2041 at 20 degC; four digits.
        for (symbol, kg_s) in [
            ("Nm3/h", 1.2922 / 3600.0),
            ("Sm3/h", 1.2250 / 3600.0),
            ("SLPM(20degC)", 1.2041e-3 / 60.0),
            ("SCFM(15degC)", 1.2250 * 0.028_316_85 / 60.0),
        ] {
            let ours = Kind::MassFlow.unit(symbol).unwrap().to_inside(1.0);
            assert!((ours / kg_s - 1.0).abs() < 1e-4, "{symbol}: {ours} against {kg_s}");
        }
        // Water boils at 212 degF = 671.67 degR = 100 degC = 373.15 K.
        for (symbol, value) in [("degF", 212.0), ("degR", 671.67), ("degC", 100.0), ("K", 373.15)] {
            let ours = Kind::Temperature.unit(symbol).unwrap().to_inside(value);
            assert!((ours - 373.15).abs() < 1e-10, "{symbol}: {ours}");
        }
    }
}

#[cfg(test)]
mod parse_tests {
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
