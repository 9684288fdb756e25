//! Possible causes of drift, and their effects on the model.

pub(crate) mod cause;
pub(crate) mod drift;
