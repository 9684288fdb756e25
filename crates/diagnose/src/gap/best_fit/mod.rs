//! The best fit of a hypothesis with its nuisances and priors, and tests whether its residual is noise.

pub(crate) mod coordinate;
pub(crate) mod fit;
pub(crate) mod fitted_causes;
pub(crate) mod normal;
