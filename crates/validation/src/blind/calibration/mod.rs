//! Calibration of the diagnosis on simulated cases: the constants that convert scores into probabilities.

pub mod calibrate;
pub(crate) mod no_cause_study;
