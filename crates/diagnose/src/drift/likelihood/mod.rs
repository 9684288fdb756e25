//! Likelihood of drift causes with their time histories, selection of the most probable set, and fit of its sizes.

pub(crate) mod candidates;
pub(crate) mod decide;
pub(crate) mod fit;
pub(crate) mod low_rank;
pub(crate) mod refinement;
pub(crate) mod residuals;
