//! All integration tests of `mapper-formats`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod descriptions;
mod formats;
mod public_shapes;
mod round_trips;
mod support;
mod surface;
mod tables;
mod turbines;
