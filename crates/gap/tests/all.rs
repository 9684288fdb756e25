//! All integration tests of `mapper-gap`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod catalogue;
mod common;
mod diagnose;
mod healthy;
mod near_surge;
mod next;
