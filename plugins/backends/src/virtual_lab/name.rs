//! The lab's name.

/// Name of this backend in campaigns.
pub const NAME: &str = "virtual_lab";
