//! Physical laws of the components: compression, wheel, turbine, bearings, valve, convection, housings, probe, and standstill.

pub mod compression;
pub mod convection;
pub mod housing;
pub mod thermocouple;
pub mod turbine;
pub mod wheel;
