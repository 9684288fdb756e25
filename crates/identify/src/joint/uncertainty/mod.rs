//! Uncertainty of the joint fit: covariances, budgets, and errors common to all points.

pub(crate) mod as_measured;
pub(crate) mod budget;
pub(crate) mod numbers;
pub(crate) mod quantity;
