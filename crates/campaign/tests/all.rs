//! All integration tests of `mapper-campaign`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod findings;
mod nightly_workflow;
mod register;
mod shipped;
