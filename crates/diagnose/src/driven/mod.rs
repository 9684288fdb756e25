//! Identification and diagnosis from a log without steps: one side of the machine, driven by its measured neighbours.
//!
//! On an engine, P3 and valve are not set and the machine never settles. The measured speed, flow, pressures and inlet temperature determine the effect
//! of the compressor on the gas. The judged channels are T2 and, if measured, Tc. [`identify`] samples all parameter values that agree with one part of
//! a log, and predicts the rest.
//!
//! The result is a posterior sample within wide priors, not a best fit: a log of 13 s cannot distinguish a slow probe from a warm housing, and the result
//! must show this.

pub mod cause_search;
mod compressor_side;
mod density;
mod ensemble;
mod error;
mod log_rows;
mod outcome;
mod parameters;

pub use error::DrivenError;
pub use log_rows::Rows;
pub use outcome::{DrivenOutcome, FoundParameter, Judged, Moves, Trace, identify};
pub use parameters::{Parameter, Spread};
