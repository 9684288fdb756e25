//! Integration tests of the module `table`.

mod workbooks;
