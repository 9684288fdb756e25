//! YAML text read within limits: its values, and the place of every key for later messages.

pub(crate) mod file;
pub(crate) mod path;
pub(crate) mod positions;
pub(crate) mod tree;
