//! Physical laws of the components: compression, turbine, bearings, valve, convection, housings, probe, and standstill.

pub mod compression;
pub mod convection;
pub mod housing;
pub mod thermocouple;
pub mod turbine;
