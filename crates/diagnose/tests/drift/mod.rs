//! Integration tests of the module `drift`.

mod common;
mod decision;
