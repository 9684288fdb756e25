//! Integration tests of the module `table`.

mod matrices;
mod wide;
mod workbooks;
