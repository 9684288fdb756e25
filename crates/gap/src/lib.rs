//! Diagnosis of the gap between the model and a rig: its location, its cause, the gap reduction and the next step. See `docs/explanation/gap.md` for
//! the method and its limits.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod actuators;
pub mod additions;
pub mod adequacy;
mod at_rest;
pub mod baseline_assumptions;
pub mod calibration;
pub mod coordinate;
mod default_tolerances;
pub mod diagnose;
pub mod effect_timing;
mod errors_of_change;
pub mod experiment;
mod extra_effects;
pub mod first_step;
pub mod fit;
pub mod folds;
mod gap_distribution;
mod gap_error;
pub mod healthy;
pub mod how_far;
pub mod hypothesis;
pub mod in_words;
mod initial_state;
pub mod joint;
pub mod machine_mismatch;
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
mod row_subset;
mod same_steps;
pub mod select;
pub mod selection;
pub mod shape;
pub mod signature;
pub mod smallest_seen;
pub mod study;
pub mod twin;
pub mod usable;
pub mod weigh;
pub mod whiten;
