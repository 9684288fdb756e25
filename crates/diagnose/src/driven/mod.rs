//! Diagnosis from a log without steps: one side of the machine, driven by its measured neighbours.
//!
//! On an engine, P3 and valve are not set and the machine never settles. The measured speed, flow, pressures and inlet temperature determine the effect
//! of the compressor on the gas. The judged channels are T2 and, if measured, Tc. [`cause_search`] fits one part of a log with and without a cause, and
//! predicts the rest.
//!
//! Every parameter has a wide prior and an interval: a log of 13 s cannot distinguish a slow probe from a warm housing, and the result must show this.

pub mod cause_search;
mod error;
mod log_rows;
mod parameters;

pub use error::DrivenError;
