//! Uncertainty of the joint fit: covariances, budgets, errors common to all points, and the profile of alpha_A.

pub(crate) mod budget;
pub(crate) mod common_part;
pub(crate) mod profile;
pub(crate) mod quantity;
pub(crate) mod smoothness;
