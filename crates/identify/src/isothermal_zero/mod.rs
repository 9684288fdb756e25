//! Sensor offsets from a soak at standstill, where all temperatures must read the same, and likewise all pressures.

pub(crate) mod groups;
pub(crate) mod periodic;
pub(crate) mod references;
pub(crate) mod soak_readings;
pub(crate) mod zero;
