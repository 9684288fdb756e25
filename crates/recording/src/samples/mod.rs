//! Samples from file to series: selection, averaging of fast logs, and correction of clocks that were set.

pub(crate) mod clock_steps;
pub(crate) mod log_clock;
pub(crate) mod rig_sink;
pub(crate) mod series_builder;
