//! All integration tests of `mapper-identify`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod budgets;
mod common;
mod conditions;
mod coverage;
mod declared_probe;
mod expected;
mod faults;
#[path = "common/honesty.rs"]
mod honesty;
mod inlet;
mod joint;
#[path = "common/lab.rs"]
mod lab;
mod moist;
mod nonsense;
mod recovery;
mod reduce;
mod robust;
mod together;
mod zero;
mod zigzag;
