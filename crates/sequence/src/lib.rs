//! Sequences written in rhai, above the planner: a script says which step comes next, and sees what the steps so far
//! have given.
//!
//! A script yields steps and nothing else. It has no file, no network, no clock and no rig; each step is checked
//! against the campaign's limits before it leaves the script ([`SequenceRequest`]), and whoever runs it keeps its own guards.
//! Operations, call depth and the size of every value are bounded, so that no script hangs or fills the memory.
//!
//! [`SequenceRunner`] runs a script on its own thread and meets it at each step: the script stands still while a step
//! is run, and the caller stands still while the script thinks. What a script may call is one table, from which both
//! the functions and their documentation ([`functions`]) are made.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod api;
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
