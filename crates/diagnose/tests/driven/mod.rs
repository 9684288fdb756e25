//! Integration tests of the module `driven`.

mod common;
mod why;
