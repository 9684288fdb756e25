//! Values with units: the table of allowed units, the parser, and [`Quantity`].
//!
//! Decimal prefixes are added to the written exponent, so that `1.1 bar` is the `f64` nearest to 110000 and
//! `52 mm` equals `52e-3`; the few other factors are exact definitions. A library for units multiplies by a rounded
//! factor, has no name for `krpm`, and parses only its own spellings; this table is short enough to check against
//! the definitions of the units.

mod kind;
mod parse;

pub use kind::{
    Area, BARE_RATIO, CUBIC_FOOT_M3, Conductance, Conductivity, Dimension, Duration, Fraction, Frequency,
    Inertia, Kind, Length, Mass, MassFlow, Pressure, PressureDifference, PressureRate, RatioRate, Speed,
    Temperature, TemperatureDifference, TemperatureRate, Unit, Volume,
};
pub use parse::{Quantity, UnitError, parse, parse_with, set};
