//! Identifies points from a recording: efficiency and heat-transfer coefficient, with their uncertainty.
//!
//! [`identify_recording`] is a function from a [`Recording`](mapper_core::Recording) to points, one for each step. This crate has no access to
//! a simulator's true values. Its stages (1 to 3 make the `evidence`, 3 to 5 the `estimates`, 6 the `points`, 7 the `turbine`):
//!
//! 1. Every step gets its end state, the mean over its last seconds; [`isothermal_zero()`] has determined the offsets to subtract before.
//! 2. Every step is fitted alone: `dynamic` finds the efficiency and the h whose T2, by eqs. 1-3, is closest to the measured one (Burke et al.,
//!    section 3); `steady` sets h to zero at the end of the step.
//! 3. The readings are checked against physics and against each other. A contradiction is searched for the fault of a sensor or of the machine
//!    that explains it; steps that stay contradicted are refused.
//! 4. `joint` fits all steps together: one law of h and a smooth efficiency for all, alpha_A, probe and heating/cooling ratio neutral or free.
//!    Errors that are not estimated, offsets and gains, are carried into the intervals.
//! 5. The smoothness of the map over speed corrects offsets that a zero did not remove.
//! 6. Every point gets an interval with its budget by source, a verdict and its reasons.
//! 7. The powers of compressor and shaft give the turbine's efficiency at the same points.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod allowance;
mod blade_count;
mod config;
mod estimates;
mod evidence;
mod faults;
mod identify;
mod isothermal_zero;
mod joint;
mod points;
mod reading_checks;
mod reduce;
mod single_step;
mod step_data;
mod step_outcome;
mod turbine;

pub use blade_count::{BladeCount, blade_count};
pub use config::{
    Allowance, DeclaredUncertainty, Housing, IdentifyConfig, NoiseColour, PressureTap, Thresholds,
    method_for, needs,
};
pub use faults::end_readings::MAX_CORRELATED_ROWS;
pub use faults::found_fault::{FoundFault, Law, Machine, Suspect};
pub use faults::nominal_rig::NominalRig;
pub use faults::valve_check::{ValveCheck, ValveState};
pub use identify::{Identified, identify, identify_each, identify_recording};
pub use isothermal_zero::groups::ZeroSettings;
pub use isothermal_zero::periodic::PeriodicError;
pub use isothermal_zero::references::CellReference;
pub use isothermal_zero::zero::{
    IsothermalZero, LeftOutSensor, NoZero, NotZeroed, ZeroOutcome, expected_after_zero, isothermal_zero,
    zeroed,
};
pub use joint::expected::expected_together;
pub use joint::step_model::rows::BLOCK_S;
pub use joint::{DynamicEfficiency, MAX_PRIOR_SENSITIVITY_ETA};
pub use mapper_core::{Choice, JointSettings, SettleBands, WindowRule};
pub use reading_checks::bounds::EFFICIENCY;
pub use reduce::{KnownHeat, method_of_table, reduce};
pub use single_step::dynamic::FittedReadings;
pub use single_step::expected::{expected, expected_steady};
pub use step_data::humidity::with_measured_humidity;
pub use step_data::samples::LONGEST_BRIDGE_S;
pub use step_outcome::error::{IdentifyError, StepError};
