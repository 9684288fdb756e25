//! Diagnosis of the gap between the model and a rig: where it lies, which effect causes it, how far it shrinks, what to
//! do next. [docs/gap.md] says how, and when not to believe it.
//!
//! [docs/gap.md]: https://example.invalid/mapper/docs/gap.md

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod declared;
pub mod fit;
pub mod inputs;
pub mod noise;
pub mod nuisance;
pub mod parallel;
pub mod shape;
pub mod smoother;
pub mod study;
pub mod table;
pub mod whiten;
