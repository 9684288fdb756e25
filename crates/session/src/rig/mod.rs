//! Operation of the rig during a run: data sources, locks, guards, observers, and preliminary results of each step.

pub(crate) mod drive;
pub(crate) mod observers;
pub(crate) mod rig_state;
pub(crate) mod sources;
