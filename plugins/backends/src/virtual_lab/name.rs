//! The lab's name.

/// Name under which campaigns ask for this backend.
pub const NAME: &str = "virtual_lab";
