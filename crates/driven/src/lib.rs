//! The compressor side of a log without steps, driven by its measured neighbours.
//!
//! On an engine nobody sets P3 and a valve, and nothing rests. What the compressor does to the gas follows from speed, flow,
//! pressures and inlet temperature as they were measured; T2 (and Tc, where it was measured) is what is judged.
//! [`identify`] finds all parameters that are in agreement with one part of a log, and says what they predict for the rest.
//!
//! The parameters are not a best fit but a sample of everything the log leaves open, within what is known of such machines
//! beforehand ([`PARAMETERS`]): a log of 13 s does not tell a slow probe from a warm housing, and the answer has to say so.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod density;
mod ensemble;
mod error;
mod outcome;
mod parameters;
mod readings;
mod rows;
mod side;
pub mod why;

pub use error::DrivenError;
pub use outcome::{DrivenOutcome, FoundParameter, Judged, Moves, Trace, identify};
pub use parameters::{PARAMETERS, Parameter, Values};
pub use readings::Readings;
pub use side::{Declared, Predicted, predict};
