//! Model predictions for whole runs, and the responses of readings to causes of drift and to constants.

pub(crate) mod constants;
pub(crate) mod drive;
pub(crate) mod driven_step;
pub(crate) mod perturbations;
pub(crate) mod readings;
