//! Integration tests of the module `table`.

mod wide;
mod workbooks;
