//! Outcome of a step in addition to its numbers: reasons for failure, warnings, and causes of wide intervals.

pub(crate) mod error;
pub(crate) mod findings;
pub(crate) mod interval_width;
