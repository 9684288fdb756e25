//! Errors of the model's equations: declared by the campaign, or measured by a fault-free reference recording of the same rig.

pub(crate) mod baseline;
pub mod baseline_assumptions;
pub(crate) mod errors_of_change;
pub(crate) mod fitted_tolerances;
pub(crate) mod measured_structure;
pub(crate) mod same_steps;
pub(crate) mod structure;
