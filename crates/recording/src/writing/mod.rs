//! Writing of a recording during a run: file, topics with their JSON schemas, messages, and quality of readings.

pub(crate) mod topics;
pub(crate) mod writer;
