//! Comparison with a fault-free reference recording of the same rig, to remove the structural error of the model.

pub mod baseline_assumptions;
pub(crate) mod errors_of_change;
pub mod healthy;
pub(crate) mod same_steps;
