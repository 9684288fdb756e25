//! Checks of YAML values against the JSON schema of a type, with a message and a suggestion for each mistake.

pub(crate) mod check;
pub(crate) mod messages;
pub(crate) mod rules;
