//! Tests of the stages of a diagnosis, which the interface of the crate hides: they are a part of the library's own tests.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs, unreachable_pub)]

mod closure;
mod gap;
