//! One complete run from preflight checks to report, with its stop signals, metadata, and resumption by replay.

pub(crate) mod commissioning;
pub(crate) mod preflight;
pub(crate) mod prepared_run;
pub(crate) mod replayed_steps;
pub(crate) mod run_stop;
