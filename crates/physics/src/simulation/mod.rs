//! The turbocharger model over time: integrator, boundary conditions, outputs, steady states, and runs on recorded inputs.

pub mod driven;
pub mod linearised_run;
pub mod model;
pub mod rosenbrock;
pub mod simulate;
pub mod steady;
