//! Choice of the next experiment or sensor, by the expected separation of the remaining candidate effects.

pub mod best_experiment;
pub(crate) mod odds;
pub mod outlook;
