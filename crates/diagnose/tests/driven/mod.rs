//! Integration tests of the module `driven`.

mod common;
mod engine;
mod why;
