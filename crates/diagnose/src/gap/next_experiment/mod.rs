//! Choice of the next experiment or sensor, by the expected separation of the remaining candidate effects.

pub(crate) mod best_experiment;
pub(crate) mod outlook;
