//! Properties of dry and moist air, and the relation of static and total pressure in a pipe.

pub mod air;
pub(crate) mod fast_power;
pub mod pressure_tap;
