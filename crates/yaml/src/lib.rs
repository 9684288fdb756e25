//! YAML that people write: read with positions, checked against a schema, mistakes shown with line and caret, values
//! written with units.
//!
//! serde_yaml reads the values, saphyr-parser their places ([`read`]). The values are checked against a JSON schema
//! ([`Schema::check`]), units and ranges included; the caller checks relations between values on the same [`Tree`]; only
//! a text without [`Notes`] is deserialised ([`Tree::deserialise`]). All mistakes of a text are reported together, as
//! [`Findings`]. This crate does not depend on the subject of the files.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod check;
mod complaint;
mod file;
mod finding;
mod findings;
mod notes;
mod path;
mod places;
mod quantity_check;
mod render;
mod rules;
mod schema;
mod source;
mod suggestion;
mod tree;
pub mod units;

pub use file::{open, open_file, read_limited};
pub use finding::{Finding, FindingKind};
pub use findings::Findings;
pub use notes::Notes;
pub use path::{Step, path_text};
pub use schema::{Schema, json_schema_of};
pub use source::{Document, Source};
pub use suggestion::closest;
pub use tree::{Tree, read};
