//! Description of the lumped turbocharger: parameters, boundary conditions, states, and extension points for effects.

pub mod boundary;
pub mod hooks;
pub mod params;
pub mod state;
