//! Parses YAML within limits: the values, and the position of every key for later messages.

pub(crate) mod file;
pub(crate) mod positions;
