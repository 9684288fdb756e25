//! Backends that protect a run from delays: rig with auxiliary instruments, and calls with a deadline.

pub(crate) mod auxiliary_instruments;
pub(crate) mod deadline;
