//! Description of the lumped turbocharger: parameters, boundary conditions, states, and extension points for effects.

pub mod hooks;
pub mod params;
