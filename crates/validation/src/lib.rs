//! Blind cases, calibration studies and the figures of the paper; above the application, never a dependency of the product.
//!
//! 1. [`blind`] draws cases: rigs on the virtual lab, or on a lab of other equations, with causes that the diagnosis does not see. The truth
//!    is sealed by its hash before the diagnosis runs.
//! 2. The diagnosis reads the recordings as any user does, and its verdicts are scored against the opened truth.
//! 3. The scores of many cases calibrate the probabilities of the diagnosis.
//! 4. [`studies`] are the same kinds of work as items of a fleet, on many computers.
//! 5. [`reproduction`] makes the figures of Burke et al. on the nominal model.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod blind;
pub mod reproduction;
pub mod studies;
