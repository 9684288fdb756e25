//! The penalised least-squares problem of a map fit: observations, shared errors, solution, and variance components.

pub(crate) mod observations;
pub(crate) mod problem;
pub(crate) mod solution;
