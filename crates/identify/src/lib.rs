//! Identifies points from a recording: efficiency and heat-transfer coefficient, with their uncertainty.
//!
//! [`identify`] is a function from a [`Recording`](mapper_core::Recording) to points, one for each step.
//! `dynamic` is the method of Burke et al., section 3; `steady` is conventional mapping. This crate has no access to a simulator's true
//! values.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod bias;
mod budgets;
mod cleaning;
mod commands;
mod config;
mod covariance;
mod dynamic;
mod end_state;
mod error;
mod expected;
mod faults;
mod findings;
mod fit;
mod flow_drift;
mod identify;
mod joint;
mod needs;
mod nominal_rig;
mod objections;
mod one_fit;
mod probe;
mod probe_reading;
mod relaxation;
mod samples;
mod steady;
mod t2_course;
mod taps;
mod two_parameter;
mod width;
mod window;
mod zero;
mod zero_outcome;

pub use config::{DeclaredUncertainty, IdentifyConfig, NoiseColour, PressureTap, Thresholds};
pub use error::{IdentifyError, StepError};
pub use expected::{Expected, ExpectedRow, expected, expected_steady};
pub use faults::found::{FoundFault, Suspect};
pub use faults::rows::Machine;
pub use findings::code;
pub use identify::{Identified, identify, identify_beside, identify_each, identify_recording};
pub use joint::MAX_RESTING_ETA;
pub use joint::expected::{ExpectedStep, ExpectedTogether, expected_together};
pub use joint::surface::EfficiencySurface;
pub use mapper_core::{
    Choice, ConvectionWithinStep, EfficiencyWithinStep, JointSettings, SettleBands, WindowRule,
};
pub use needs::{method_for, needs};
pub use nominal_rig::NominalRig;
#[doc(hidden)]
pub use one_fit::{OneFit, one_fit};
pub use t2_course::{T2Course, t2_course};
pub use two_parameter::TwoParameter;
pub use zero::{
    IsothermalZero, NoZero, ZeroSettings, expected_after_zero, isothermal_zero, isothermal_zero_with_a_fault,
    zeroed,
};
pub use zero_outcome::ZeroOutcome;
