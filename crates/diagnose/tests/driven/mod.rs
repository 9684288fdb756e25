//! All integration tests of `mapper-diagnose`: one program, since each further one would be compiled and linked by itself.

mod common;
mod engine;
mod why;
