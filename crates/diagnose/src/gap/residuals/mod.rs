//! Whitened residuals of a recording under any hypothesis of nuisances and effects, as input of the gap diagnosis.

pub(crate) mod nuisance;
pub(crate) mod prediction;
pub(crate) mod study;
pub(crate) mod true_inputs;
pub(crate) mod whiten;
