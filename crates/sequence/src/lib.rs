//! Runs test sequences written in rhai: scripts that replace the planner and choose each step from the results of the previous ones.
//!
//! `session` starts a [`SequenceRunner`], which runs the script on its own thread and synchronises with it at each step: the script waits
//! while a step is executed, and the caller waits while the script computes.
//!
//! A script can only yield steps. It has no access to files, network, clock or rig. Each step is checked against the limits of the
//! campaign ([`SequenceRequest`]), and the guards of the run still apply. Operations, call depth and the size of every value are limited,
//! so a script can neither hang the program nor exhaust its memory. One table defines the functions of a script and their documentation
//! ([`functions`]).

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod api;
mod error;
mod request;
mod runner;
mod sandbox;
mod session;
mod settle;

pub use api::{Entry, functions};
pub use error::{ScriptError, SequenceError};
pub use request::{OrderPoints, SequenceRequest};
pub use runner::{Script, SequenceRunner};
pub use settle::{EndCondition, SequenceStep, SettleRule, SettleWatch, StepResult};
