//! Compares a recording with the model: channels, time base, noise, model inputs, and permitted differences.
//!
//! The diagnosis of the gap and the search for drift both drive the nominal model by a recording and explain the residual. They share this
//! crate; each keeps its own statistics. Identification takes the plausible readings from here.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod averaged_inputs;
pub mod block;
pub mod channels;
pub mod declared;
mod element_blocks;
pub mod element_fault;
mod element_judge;
pub mod fuse;
pub mod lagged_command;
pub mod mean;
pub mod perturbation;
pub mod plausible;
pub mod same_machine;
pub mod schedule;
pub mod smoothed_inputs;
pub mod smoother;
pub mod start;
pub mod step_timing;
pub mod table;

pub use declared::{Declared, declared_uncertainties};
pub use element_fault::{Contradiction, Fault, FaultyElement, FusedChannel};
pub use fuse::{fuse, judge_elements};
pub use same_machine::{OtherMachine, same_machine};
