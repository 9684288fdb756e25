//! The quantities of names.

/// A quantity that a name may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the quantities")]
pub enum Measured {
    Temperature,
    Pressure,
    Speed,
    Flow,
    VolumeFlow,
    PressureRatio,
    Efficiency,
    Humidity,
    Opening,
    Vane,
}
