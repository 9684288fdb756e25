//! The directory that the machines of a study share: its layout, study description, work items, and their results.

pub(crate) mod files;
pub(crate) mod fleet;
pub(crate) mod part;
pub(crate) mod study;
