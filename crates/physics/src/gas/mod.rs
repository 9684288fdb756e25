//! Properties of air and of gas mixtures, and the relation of static and total pressure in a pipe.

pub mod air;
pub mod mixture;
pub mod pressure_tap;
