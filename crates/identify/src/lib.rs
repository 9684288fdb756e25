//! Identifies points from a recording: efficiency and heat-transfer coefficient, with their uncertainty.
//!
//! [`identify`] is a function from a [`Recording`](mapper_core::Recording) to points, one for each step.
//! `dynamic` is the method of Burke et al., section 3; `steady` is conventional mapping. This crate has no access to a simulator's true
//! values.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod config;
mod faults;
mod identify;
mod isothermal_zero;
mod joint;
mod needs;
mod reading_checks;
mod reduce;
mod single_step;
mod step_data;
mod step_outcome;

pub use config::{DeclaredUncertainty, IdentifyConfig, NoiseColour, PressureTap, Thresholds};
pub use faults::balance_rows::Machine;
pub use faults::end_readings::MAX_CORRELATED_ROWS;
pub use faults::found_fault::{FoundFault, Suspect};
pub use faults::nominal_rig::NominalRig;
pub use identify::{Identified, identify, identify_each, identify_recording};
pub use isothermal_zero::zero::{
    IsothermalZero, NoZero, ZeroSettings, expected_after_zero, isothermal_zero, zeroed,
};
pub use isothermal_zero::zero_outcome::ZeroOutcome;
pub use joint::expected::expected_together;
pub use joint::step_model::rows::BLOCK_S;
pub use joint::{MAX_RESTING_ETA, TwoParameter};
pub use mapper_core::{Choice, JointSettings, SettleBands, WindowRule};
pub use needs::{method_for, needs};
pub use reading_checks::bounds::EFFICIENCY;
pub use reduce::{KnownHeat, method_of_table, reduce};
pub use single_step::expected::{expected, expected_steady};
pub use single_step::t2_history::{T2History, t2_history};
pub use step_data::humidity::with_measured_humidity;
pub use step_data::samples::LONGEST_BRIDGE_S;
pub use step_outcome::error::{IdentifyError, StepError};
