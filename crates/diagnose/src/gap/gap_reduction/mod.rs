//! Gap reduction by a cause on held-out steps, with cross-validation folds and confidence interval.

pub mod beyond_prior;
pub mod folds;
pub(crate) mod gap_distribution;
pub mod held_out_gap;
