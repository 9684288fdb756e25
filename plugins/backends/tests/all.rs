//! All integration tests of `mapper-backends`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

#[path = "conformance/main.rs"]
mod conformance;
mod other_lab;
mod virtual_lab;
