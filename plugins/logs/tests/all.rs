//! All integration tests of `mapper-log-formats`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod atfx;
mod channel_maps;
mod clock_steps;
mod delimited;
mod headers;
mod hostile;
mod hostile_columns;
mod hostile_logs;
mod layouts;
mod mdf4;
mod proposals;
