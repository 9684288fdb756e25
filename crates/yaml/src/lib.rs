//! YAML that people write: read with positions, checked against a schema, mistakes shown with line and caret, values
//! written with units.
//!
//! The text becomes a tree that keeps positions ([`read`]); the tree is checked against a JSON schema
//! ([`Schema::check`]), units and ranges included; the caller checks what no schema can say on the same tree; only a
//! tree without [`Notes`] is deserialised ([`Node::deserialise`]). All mistakes of a text come in one go, as
//! [`Findings`]. This crate does not depend on the subject of the files.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod check;
mod complaint;
mod file;
mod finding;
mod findings;
mod keywords;
mod notes;
mod quantity_check;
mod reader;
mod render;
mod rules;
mod scalar;
mod schema;
mod source;
mod suggestion;
mod tree;
pub mod units;

pub use file::{open, open_file, read_limited};
pub use finding::{Finding, FindingKind};
pub use findings::Findings;
pub use notes::Notes;
pub use reader::read;
pub use schema::{Schema, json_schema_of};
pub use source::{Document, Source};
pub use suggestion::closest;
pub use tree::{Content, Entry, Node, ReadError, Step, path_text};
