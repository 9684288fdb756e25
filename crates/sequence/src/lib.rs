//! Sequences written in rhai, an alternative to the planner: a script chooses each next step from the results of the
//! previous ones.
//!
//! A script can only yield steps. It has no access to files, network, clock or rig. Each step is checked against the campaign's
//! limits before it leaves the script ([`SequenceRequest`]), and the runner of the steps keeps its own guards.
//! Operations, call depth and the size of every value are bounded, so that no script hangs or exhausts the memory.
//!
//! [`SequenceRunner`] runs a script on its own thread and synchronises with it at each step. The script waits while a step
//! is executed, and the caller waits while the script computes. One table defines the functions that a script may call, and both
//! their registration and their documentation ([`functions`]) come from it.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod api;
mod comments;
mod error;
mod forecast;
mod names;
mod request;
mod result;
mod runner;
mod sandbox;
mod session;
mod settle;
mod step;

pub use api::{Entry, functions};
pub use error::{ScriptError, SequenceError};
pub use request::{OrderPoints, SequenceRequest};
pub use result::StepResult;
pub use runner::{Script, SequenceRunner};
pub use settle::{SettleRule, SettleWatch};
pub use step::{Hold, SequenceStep};
