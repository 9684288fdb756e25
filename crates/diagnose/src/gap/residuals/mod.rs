//! Whitened residuals of a recording under any hypothesis of nuisances and effects, as input of the gap diagnosis.

pub mod actuators;
pub(crate) mod changed_study;
pub(crate) mod hypothesis;
pub(crate) mod initial_state;
pub(crate) mod machine_run;
pub mod nuisance;
pub(crate) mod point_state;
pub(crate) mod prediction;
pub(crate) mod shape;
pub mod study;
pub(crate) mod true_inputs;
pub mod whiten;
