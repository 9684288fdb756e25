//! Whitened residuals of a recording under any hypothesis of nuisances and effects, as input of the gap diagnosis.

pub(crate) mod machine_run;
pub(crate) mod nuisance;
pub(crate) mod point_state;
pub(crate) mod prediction;
pub(crate) mod shape;
pub(crate) mod study;
pub(crate) mod true_inputs;
pub(crate) mod whiten;
