//! What the program is called.

/// Name and version of the program, as recordings carry it.
pub const PROGRAM: &str = concat!("mapper ", env!("CARGO_PKG_VERSION"));
