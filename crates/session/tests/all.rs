//! All integration tests of `mapper-session`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod chaos;
mod commission;
mod common;
mod hostile_plans;
mod housing;
mod joint_plan;
mod reduce;
mod speed;
mod stands;
