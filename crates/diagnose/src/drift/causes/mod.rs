//! Possible causes of drift, their time histories, and their effects on the model.

pub(crate) mod cause;
pub(crate) mod drift;
pub(crate) mod time_history;
