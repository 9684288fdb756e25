//! Sources of the runner's steps: plans, the initial soak, repeated jumps against drift, and the surge search.

pub(crate) mod drift_watch;
pub(crate) mod step_source;
pub(crate) mod surge_search;
