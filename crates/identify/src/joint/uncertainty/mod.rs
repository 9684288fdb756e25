//! Uncertainty of the joint fit: covariances, budgets, and errors common to all points.

pub(crate) mod budget;
pub(crate) mod common_part;
pub(crate) mod quantity;
pub(crate) mod smoothness;
