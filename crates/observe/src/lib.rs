//! Prepares a recording for comparison with the model: time base, noise, model inputs, and declared uncertainty.
//!
//! Shared by the diagnosis of gaps, which drives the nominal model by a recording and explains the residual, by the search for drift, and
//! by the identification. A [`Table`](averages::Table) has all channels at the same times.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod acceptance;
pub mod averages;
pub mod declared;
pub(crate) mod element_judge;
pub mod energy_balance;
pub mod fuse;
mod measured_stand;
pub mod model_inputs;
pub mod perturbation;

pub use declared::{Declared, declared_uncertainties};
pub use element_judge::{Contradiction, ElementFault, FaultyElement, FusedChannel};
pub use fuse::{fuse, judge_elements};
pub use measured_stand::{Fitted, MeasuredValue, OtherMachine, measure_actuators, same_machine};
