//! Checks before any fit: whether a recording can be diagnosed and belongs to the nominal machine.

pub(crate) mod default_tolerances;
pub(crate) mod machine_mismatch;
pub mod problem;
pub mod usable;
