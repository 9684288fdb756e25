//! Campaign files and nightly files: reading with a report of all mistakes, and the JSON schema for editors.

pub(crate) mod load;
pub(crate) mod nightly;
