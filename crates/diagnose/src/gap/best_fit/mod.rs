//! The best fit of a hypothesis with its nuisances and priors, and tests whether its residual is noise.

pub mod adequacy;
pub mod coordinate;
pub mod fit;
pub mod normal;
