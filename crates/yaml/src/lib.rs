//! Reads YAML files that people write (campaigns, channel maps, studies), and reports all their mistakes with line, caret and remedy.
//! Values are written with units.
//!
//! serde_yaml reads the values, saphyr-parser their places ([`read`]). The values are checked against a JSON schema
//! ([`Schema::check`]), units and ranges included; the caller checks relations between values on the same [`Tree`]; only
//! a text without [`Notes`] is deserialised ([`Tree::deserialise`]). All mistakes of a text are reported together, as
//! [`Findings`]. This crate does not depend on the subject of the files.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod check;
mod document;
pub mod keys;
mod rules;
mod source;
pub mod units;

pub use check::{Schema, json_schema_of};
pub use document::file::{open, open_file, read_limited};
pub use document::positions::{Step, Tree, path_text, read};
pub use source::{Document, Finding, FindingKind, Findings, Notes, Source, closest};
