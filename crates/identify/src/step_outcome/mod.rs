//! Outcome of a step in addition to its numbers: reasons for failure, and warnings with causes of wide intervals.

pub(crate) mod error;
pub(crate) mod findings;
