//! The best fit of a hypothesis with its nuisances and priors, and tests whether its residual is noise.

pub mod adequacy;
pub mod coordinate;
pub(crate) mod first_step;
pub mod fit;
pub(crate) mod normal;
pub(crate) mod projector;
pub mod selection;
pub mod signature;
