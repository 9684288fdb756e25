//! Diagnosis of the gap between the model and a rig: where it lies, which effect causes it, how far it shrinks, what to
//! do next. `docs/gap.md` says how, and when not to believe it.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod actuators;
mod added;
pub mod additions;
pub mod adequacy;
pub mod another_machine;
mod assumed;
mod at_rest;
pub mod calibration;
mod carried;
pub mod coordinate;
pub mod course;
pub mod diagnose;
mod errors_of_change;
pub mod experiment;
pub mod first_step;
pub mod fit;
pub mod folds;
mod gap_error;
pub mod healthy;
pub mod how_far;
pub mod hypothesis;
pub mod in_words;
pub mod joint;
mod kept;
mod misfit;
pub mod next;
pub mod normal;
pub mod nuisance;
pub mod odds;
pub mod outlook;
pub mod place;
pub mod point_state;
pub mod problem;
mod projector;
pub mod report;
mod rest;
mod same_steps;
pub mod select;
pub mod selection;
pub mod shape;
pub mod signature;
pub mod since;
pub mod smallest_seen;
pub mod study;
pub mod twin;
pub mod usable;
mod weigh;
pub mod whiten;
