//! Gap reduction by a cause on held-out steps, with cross-validation folds and confidence interval.

pub mod folds;
pub(crate) mod gap_distribution;
pub mod how_far;
pub mod strain;
