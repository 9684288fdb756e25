//! All integration tests of `mapper-recording`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod channel_map;
mod common;
mod damage;
mod round_trip;
