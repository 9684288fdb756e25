//! Integration tests of the module `reproduction`.

mod figures;
