//! Properties of air and of gas mixtures, and the relation of static and total pressure in a pipe.

pub mod air;
pub(crate) mod fast_power;
pub mod mixture;
pub mod pressure_tap;
pub mod species;
