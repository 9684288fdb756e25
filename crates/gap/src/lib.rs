//! Diagnosis of the gap between the model and a rig: where it lies, which effect causes it, how far it shrinks, what to
//! do next. `docs/gap.md` says how, and when not to believe it.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod adequacy;
pub mod calibration;
pub mod check;
pub mod declared;
pub mod diagnose;
pub mod fit;
pub mod how_far;
pub mod inputs;
pub mod next;
pub mod noise;
pub mod nuisance;
pub mod outlook;
pub mod parallel;
pub mod place;
pub mod report;
pub mod screen;
pub mod select;
pub mod shape;
pub mod signature;
pub mod smoother;
pub mod study;
pub mod table;
pub mod whiten;
