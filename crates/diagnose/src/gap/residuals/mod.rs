//! Whitened residuals of a recording under any hypothesis of nuisances and effects, as input of the gap diagnosis.

pub mod actuators;
pub mod effect_timing;
pub(crate) mod extra_effects;
pub mod hypothesis;
pub(crate) mod initial_state;
pub mod nuisance;
pub mod point_state;
pub(crate) mod row_subset;
pub mod shape;
pub mod study;
pub(crate) mod true_inputs;
pub mod whiten;
