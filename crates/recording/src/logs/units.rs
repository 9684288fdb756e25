//! Units of recordings by other programs, in more spellings than `mapper-yaml` accepts.

use mapper_core::{Channel, Dimension};
use mapper_yaml::units::{BARE_RATIO, Kind, Unit, UnitError, parse_with};

/// The kind of quantity that a channel measures.
pub fn kind_of(channel: Channel) -> Kind {
    match channel.info().dimension {
        Dimension::RotationalSpeed => Kind::Speed,
        Dimension::MassFlow => Kind::MassFlow,
        Dimension::Pressure => Kind::Pressure,
        Dimension::Temperature => Kind::Temperature,
        Dimension::Ratio => Kind::Fraction,
    }
}

/// The kind of noise and offsets of a reading.
pub fn difference(kind: Kind) -> Kind {
    match kind {
        Kind::Temperature => Kind::TemperatureDifference,
        Kind::Pressure => Kind::PressureDifference,
        other => other,
    }
}

/// The unit with a spelling of this or another program.
///
/// # Errors
/// [`UnitError::WrongUnit`] for what is not a unit of the kind.
pub fn unit(kind: Kind, spelling: &str) -> Result<&'static Unit, UnitError> {
    let spelling = spelling.trim();
    find(kind, spelling).ok_or_else(|| UnitError::WrongUnit { unit: spelling.to_owned(), kind })
}

/// Parses a number with its unit, such as `29e-3 m^2`, to SI and rpm. A ratio needs no unit.
///
/// # Errors
/// [`UnitError`] for what is not a finite number, for an unknown unit, and for a missing one.
pub fn parse_quantity(kind: Kind, text: &str) -> Result<f64, UnitError> {
    parse_with(kind, text, |spelling| match spelling {
        "" => (kind == Kind::Fraction).then_some(&BARE_RATIO),
        spelling => find(kind, spelling),
    })
}

/// The remedy for an error: the units that are valid.
pub fn remedy(kind: Kind, error: &UnitError) -> String {
    let bare = if kind == Kind::Fraction { "; a ratio may be written with `1`" } else { "" };
    format!("{}{bare}", error.remedy(kind))
}

fn find(kind: Kind, spelling: &str) -> Option<&'static Unit> {
    kind.unit(spelling).or_else(|| match (kind, spelling) {
        (Kind::Fraction, "1" | "-") => Some(&BARE_RATIO),
        (Kind::Temperature, "C" | "celsius") => kind.unit("degC"),
        (Kind::Temperature, "F") => kind.unit("degF"),
        // Unambiguous for a channel: channels contain absolute pressures.
        (Kind::Pressure, "psi") => kind.unit("psia"),
        // Unambiguous for an interval too: only the scale counts, and degF and degR have the same.
        (Kind::TemperatureDifference, "degC" | "°C") => kind.unit("K"),
        (Kind::TemperatureDifference, "degF" | "°F") => Kind::Temperature.unit("degR"),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::CHANNELS;

    #[test]
    fn foreign_spellings_mean_what_their_programs_mean() {
        // Definitions of the units; NIST SP 811 for psi (tolerance: its seven digits).
        for (kind, text, inside) in [
            (Kind::Temperature, "25 C", 298.15),
            (Kind::Temperature, "25celsius", 298.15),
            (Kind::Temperature, "212 F", 373.15),
            (Kind::TemperatureDifference, "0.25 degC", 0.25),
            (Kind::TemperatureDifference, "1.8 °F", 1.0),
            (Kind::Pressure, "14.695948775 psi", 101_325.0),
            (Kind::PressureDifference, "0.01 psi", 68.947_57),
            (Kind::Speed, "110e3 rev/min", 110e3),
            (Kind::Speed, "1000 rev/s", 60e3),
            (Kind::MassFlow, "36 kg/hr", 0.01),
            (Kind::MassFlow, "1 lb/s", 0.453_592_37),
            (Kind::Fraction, "0.7", 0.7),
            (Kind::Fraction, "0.7 1", 0.7),
            (Kind::Fraction, "50 %", 0.5),
        ] {
            let got = parse_quantity(kind, text).unwrap();
            assert!((got - inside).abs() <= 5e-8 * inside, "{text}: {got}");
        }
    }

    #[test]
    fn the_native_unit_of_every_channel_leaves_every_bit_as_it_is() {
        for row in CHANNELS {
            let native = unit(kind_of(row.channel), row.dimension.unit()).unwrap();
            for value in [-0.0, 0.1, 98_100.123_456_789] {
                assert_eq!(native.to_inside(value).to_bits(), f64::to_bits(value), "{}", row.symbol);
            }
        }
    }

    #[test]
    fn text_that_is_not_a_quantity_is_refused() {
        for (kind, text) in [
            (Kind::Fraction, ""),
            (Kind::Pressure, "abc"),
            (Kind::Pressure, "5"),
            (Kind::Pressure, "5 K"),
            (Kind::Pressure, "5 barg"),
            (Kind::Temperature, "inf K"),
            (Kind::Temperature, "1e999 K"),
            (Kind::Fraction, "nan"),
            (Kind::Fraction, "1e999"),
        ] {
            assert!(parse_quantity(kind, text).is_err(), "{text}");
        }
        assert!(unit(Kind::Fraction, "").is_err());
    }
}
