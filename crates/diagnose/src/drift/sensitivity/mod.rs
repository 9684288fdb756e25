//! Model predictions for whole runs, and the sensitivity of readings to drift causes and constants.

pub(crate) mod drive;
pub(crate) mod knobs;
pub(crate) mod nuisance;
pub(crate) mod readings;
pub(crate) mod segment;
