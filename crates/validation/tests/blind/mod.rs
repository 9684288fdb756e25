//! Integration tests of the module `blind`.

mod baseline;
mod cases;
