//! Integration tests of the module `missing_terms`.

mod discover;
