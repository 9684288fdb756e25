//! The directory that the machines of a study share: its layout, study description, work items, and their results.

pub(crate) mod error;
pub(crate) mod fleet;
pub(crate) mod hash;
pub(crate) mod item;
pub(crate) mod kind;
pub(crate) mod kinds;
pub(crate) mod part;
pub(crate) mod shared_files;
pub(crate) mod study;
pub(crate) mod study_file;
pub(crate) mod study_writer;
