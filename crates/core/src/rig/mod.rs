//! Terms that campaigns, runner and backends share: backend interface, limits, guards, soak, run-down, and surge search.

pub(crate) mod backend;
pub(crate) mod clock;
pub(crate) mod guard;
pub(crate) mod limits;
pub(crate) mod on_drift;
pub(crate) mod run_down;
pub(crate) mod run_ending;
pub(crate) mod soak;
pub(crate) mod speed_response;
pub(crate) mod surge;
