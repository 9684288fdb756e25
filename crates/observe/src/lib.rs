//! Compares a recording with the model: channels, time base, noise, model inputs, and permitted differences.
//!
//! The diagnosis of the gap and the search for drift both drive the nominal model by a recording and explain the residual. They share this
//! crate; each keeps its own statistics. Identification takes the plausible readings from here.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod acceptance;
pub mod averages;
pub mod channels;
pub mod declared;
pub mod energy_balance;
pub mod initial_state;
pub mod model_inputs;
pub mod perturbation;
pub mod plausible;
pub mod redundant_sensors;
pub mod same_machine;

pub use declared::{Declared, declared_uncertainties};
pub use redundant_sensors::element_fault::{Contradiction, Fault, FaultyElement, FusedChannel};
pub use redundant_sensors::fuse::{fuse, judge_elements};
pub use same_machine::{OtherMachine, same_machine};
