//! Possible causes and time histories of drift, and the model with a detected drift for the next fit.

pub(crate) mod cause;
pub(crate) mod planted;
pub(crate) mod time_history;
