//! Integration tests of the module `blind`.

mod cases;
mod healthy;
