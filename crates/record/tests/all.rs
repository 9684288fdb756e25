//! All integration tests of `mapper-record`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod channel_map;
mod clock_steps;
mod common;
mod damage;
mod hostile_logs;
mod logs;
mod round_trip;
