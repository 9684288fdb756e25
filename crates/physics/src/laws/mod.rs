//! Physical laws of the components: compression, turbine, bearings, valve, convection, housings, probe, and standstill.

pub mod bearing_friction;
pub mod compression;
pub mod housing;
pub mod inlet_convection;
pub mod nusselt;
pub mod orifice;
pub mod standstill;
pub mod thermocouple;
pub mod turbine;
