//! Units as people write them, and their conversion to the unit used inside.

use mapper_core::{Channel, Dimension};

/// What a value measures; decides which units may be written for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// rpm inside.
    RotationalSpeed,
    /// kg/s inside.
    MassFlow,
    /// Pa inside, absolute.
    Pressure,
    /// K inside.
    Temperature,
    /// K inside; an interval, so that degC has no offset.
    TemperatureDifference,
    /// 1 inside.
    Ratio,
    /// s inside.
    Time,
    /// m inside.
    Length,
    /// m2 inside.
    Area,
}

impl Kind {
    /// What a channel measures.
    pub fn of(channel: Channel) -> Kind {
        match channel.info().dimension {
            Dimension::RotationalSpeed => Kind::RotationalSpeed,
            Dimension::MassFlow => Kind::MassFlow,
            Dimension::Pressure => Kind::Pressure,
            Dimension::Temperature => Kind::Temperature,
            Dimension::Ratio => Kind::Ratio,
        }
    }

    /// The same kind for noise and offsets of a reading.
    pub fn difference(self) -> Kind {
        if self == Kind::Temperature { Kind::TemperatureDifference } else { self }
    }

    fn examples(self) -> &'static str {
        match self {
            Kind::RotationalSpeed => "rpm, krpm, Hz, rad/s",
            Kind::MassFlow => "kg/s, g/s, kg/h, lb/min",
            Kind::Pressure => "Pa, hPa, kPa, bar, mbar, psi (absolute)",
            Kind::Temperature => "K, degC, degF",
            Kind::TemperatureDifference => "K, degC, degF",
            Kind::Ratio => "1, %",
            Kind::Time => "s, ms, min, h",
            Kind::Length => "m, mm, cm, in",
            Kind::Area => "m^2, cm^2, mm^2",
        }
    }
}

/// Why a unit or a value with a unit was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// The unit is unknown, or measures something else.
    #[error("`{unit}` is not a unit for this; units are {expected}")]
    NotAUnit {
        /// What was written.
        unit: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The value is no number.
    #[error("`{text}` does not start with a number; write a number and a unit ({expected})")]
    NotANumber {
        /// What was written.
        text: String,
        /// Units that would be right.
        expected: &'static str,
    },
    /// A bare number where a unit is needed.
    #[error("`{text}` has no unit; write one of {expected} after it")]
    NoUnit {
        /// What was written.
        text: String,
        /// Units that would be right.
        expected: &'static str,
    },
}

/// A unit: `inside = (written + shift) * factor`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    shift: f64,
    factor: f64,
    divisor: f64,
}

impl Unit {
    /// The unit used inside the program.
    pub const INSIDE: Unit = Unit { shift: 0.0, factor: 1.0, divisor: 1.0 };

    /// The unit called `name` for a value of this kind.
    ///
    /// # Errors
    /// [`UnitError::NotAUnit`] for a name that is no unit of the kind.
    pub fn parse(name: &str, kind: Kind) -> Result<Unit, UnitError> {
        let name = name.trim();
        lookup(name, kind)
            .ok_or_else(|| UnitError::NotAUnit { unit: name.to_owned(), expected: kind.examples() })
    }

    /// A written value in the unit used inside.
    pub fn to_inside(self, written: f64) -> f64 {
        // Adding nothing would turn -0 into 0, and what is written inside has to read back to the bit.
        let shifted = if self.shift == 0.0 { written } else { written + self.shift };
        // A division where the definition has one: 1/3600 and 5/9 have no exact factor.
        shifted * self.factor / self.divisor
    }
}

/// A number with its unit, such as `29e-3 m^2`, in the unit used inside. A ratio may stand without a unit.
///
/// # Errors
/// [`UnitError`] for what is no finite number, for an unknown unit, and for a missing one.
pub(crate) fn parse_quantity(text: &str, kind: Kind) -> Result<f64, UnitError> {
    let text = text.trim();
    let expected = kind.examples();
    let not_a_number = || UnitError::NotANumber { text: text.to_owned(), expected };
    let (number, unit) = split_number(text).ok_or_else(not_a_number)?;
    if !number.is_finite() {
        return Err(not_a_number());
    }
    match unit {
        "" if kind == Kind::Ratio => Ok(number),
        "" => Err(UnitError::NoUnit { text: text.to_owned(), expected }),
        unit => Ok(Unit::parse(unit, kind)?.to_inside(number)),
    }
}

/// The longest start of the text that is a number, and what follows it.
fn split_number(text: &str) -> Option<(f64, &str)> {
    let numeric = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
    let longest = text.find(|c| !numeric(c)).unwrap_or(text.len());
    // All of these characters are one byte long, so every length up to `longest` is a boundary.
    (1..=longest).rev().find_map(|end| Some((text[..end].parse().ok()?, text[end..].trim())))
}

fn lookup(name: &str, kind: Kind) -> Option<Unit> {
    let scaled = |factor: f64| Some(Unit { shift: 0.0, factor, divisor: 1.0 });
    let divided = |factor: f64, divisor: f64| Some(Unit { shift: 0.0, factor, divisor });
    match kind {
        Kind::RotationalSpeed => match name {
            "rpm" | "1/min" | "rev/min" | "min^-1" => scaled(1.0),
            "krpm" => scaled(1000.0),
            "Hz" | "rev/s" | "1/s" => scaled(60.0),
            "rad/s" => divided(30.0, std::f64::consts::PI),
            _ => None,
        },
        Kind::MassFlow => match name {
            "kg/s" => scaled(1.0),
            "g/s" => divided(1.0, 1000.0),
            "kg/min" => divided(1.0, 60.0),
            "kg/h" | "kg/hr" => divided(1.0, 3600.0),
            "lb/s" => scaled(0.453_592_37),
            "lb/min" => divided(0.453_592_37, 60.0),
            _ => None,
        },
        Kind::Pressure => match name {
            "Pa" => scaled(1.0),
            "hPa" | "mbar" => scaled(100.0),
            "kPa" => scaled(1000.0),
            "MPa" => scaled(1e6),
            "bar" => scaled(1e5),
            "atm" => scaled(101_325.0),
            "psi" | "psia" => scaled(6_894.757_293_168),
            _ => None,
        },
        Kind::Temperature => match name {
            "K" => scaled(1.0),
            "degC" | "°C" | "C" | "celsius" => Some(Unit { shift: 273.15, factor: 1.0, divisor: 1.0 }),
            "degF" | "°F" | "F" => Some(Unit { shift: 459.67, factor: 5.0, divisor: 9.0 }),
            _ => None,
        },
        Kind::TemperatureDifference => match name {
            "K" | "degC" | "°C" => scaled(1.0),
            "degF" | "°F" => divided(5.0, 9.0),
            _ => None,
        },
        Kind::Ratio => match name {
            "1" | "-" => scaled(1.0),
            "%" => divided(1.0, 100.0),
            _ => None,
        },
        Kind::Time => match name {
            "s" => scaled(1.0),
            "ms" => divided(1.0, 1000.0),
            "min" => scaled(60.0),
            "h" => scaled(3600.0),
            _ => None,
        },
        Kind::Length => match name {
            "m" => scaled(1.0),
            "cm" => divided(1.0, 100.0),
            "mm" => divided(1.0, 1000.0),
            "in" => scaled(0.0254),
            _ => None,
        },
        Kind::Area => match name {
            "m^2" | "m2" | "m²" => scaled(1.0),
            "cm^2" | "cm2" | "cm²" => divided(1.0, 1e4),
            "mm^2" | "mm2" | "mm²" => divided(1.0, 1e6),
            _ => None,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the NIST guide to the SI (SP 811) and definitions.
    #[test]
    fn units_convert_as_defined() {
        let cases = [
            ("25 degC", Kind::Temperature, 298.15),
            ("212 degF", Kind::Temperature, 373.15),
            ("0.25 degC", Kind::TemperatureDifference, 0.25),
            ("1.8 degF", Kind::TemperatureDifference, 1.0),
            ("145.882 kPa", Kind::Pressure, 145_882.0),
            ("14.695948775 psi", Kind::Pressure, 101_325.0),
            ("110krpm", Kind::RotationalSpeed, 110e3),
            ("628.3185307179587 rad/s", Kind::RotationalSpeed, 6000.0),
            ("36 kg/h", Kind::MassFlow, 0.01),
            ("29e-3 m^2", Kind::Area, 0.029),
            ("35 mm", Kind::Length, 0.035),
            ("2 min", Kind::Time, 120.0),
            ("50 %", Kind::Ratio, 0.5),
            ("0.7", Kind::Ratio, 0.7),
        ];
        for (text, kind, expected) in cases {
            let got = parse_quantity(text, kind).unwrap();
            // Rounding of a product and a quotient, and of the tabulated psi.
            assert!((got - expected).abs() <= 1e-9 * expected.abs(), "{text}: {got}");
        }
    }

    #[test]
    fn what_is_no_quantity_is_refused() {
        for (text, kind) in [
            ("", Kind::Ratio),
            ("abc", Kind::Pressure),
            ("5", Kind::Pressure),
            ("5 K", Kind::Pressure),
            ("5 barg", Kind::Pressure),
            ("inf K", Kind::Temperature),
            ("1e999 K", Kind::Temperature),
            ("nan", Kind::Ratio),
        ] {
            assert!(parse_quantity(text, kind).is_err(), "{text}");
        }
    }
}
