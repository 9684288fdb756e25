//! Terms that campaigns, runner and backends share: backend interface, limits, guards, soak, run-down, and surge search.

pub(crate) mod actuators;
pub(crate) mod avoided_speeds;
pub(crate) mod backend;
pub(crate) mod guard;
pub(crate) mod limits;
pub(crate) mod surge;
