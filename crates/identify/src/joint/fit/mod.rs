//! Least-squares solution of the joint fit, its noise model, and the selection of optional model parameters.

pub(crate) mod input_noise;
pub(crate) mod refinements;
pub(crate) mod solve;
pub(crate) mod start;
pub(crate) mod step_noise;
