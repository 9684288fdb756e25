//! Mistakes of a file collected during its checks, and their display with source line and remedy.

pub(crate) mod finding;
pub(crate) mod source;
