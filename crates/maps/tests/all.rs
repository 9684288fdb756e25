//! All integration tests of `mapper-maps`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod assemble;
mod derived;
mod efficiency;
mod line_ends;
mod map_fit;
mod support;
mod table;
mod turbine;
