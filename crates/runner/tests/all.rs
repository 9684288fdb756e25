//! All integration tests of `mapper-runner`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod connecting;
mod drift_watch;
mod plausibility;
mod readers;
mod run;
