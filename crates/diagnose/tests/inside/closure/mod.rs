//! Integration tests of the module `closure`.

mod discover;
