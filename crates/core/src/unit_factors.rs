//! Exact factors between units, each written once.

/// Seconds in a minute.
pub const S_PER_MIN: f64 = 60.0;
/// Seconds in an hour.
pub const S_PER_H: f64 = 3600.0;
/// Nanoseconds in a second.
pub const NS_PER_S: f64 = 1e9;
/// Millimetres in a metre.
pub const MM_PER_M: f64 = 1e3;
/// Metres in a millimetre.
pub const M_PER_MM: f64 = 1e-3;
/// Grams in a kilogram.
pub const G_PER_KG: f64 = 1e3;
/// Square centimetres in a square metre.
pub const CM2_PER_M2: f64 = 1e4;
/// Pascals in a kilopascal.
pub const PA_PER_KPA: f64 = 1e3;
/// Revolutions per minute in a thousand of them.
pub const RPM_PER_KRPM: f64 = 1e3;
/// Per cent in a ratio of 1.
pub const PERCENT: f64 = 100.0;
/// Ice point, K: 0 degC (ITS-90).
pub const ICE_POINT_K: f64 = 273.15;
