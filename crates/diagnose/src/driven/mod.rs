//! Diagnosis from a log without steps: one side of the machine, driven by its measured neighbours.
//!
//! On an engine, P3 and valve are not set and the machine never settles. The measured speed, flow, pressures and inlet temperature determine the effect
//! of the compressor on the gas. The judged channels are T2 and, if measured, Tc. [`diagnose`] fits one part of a log with and without a cause, and
//! predicts the rest.
//!
//! Every parameter has a wide prior and an interval: a log of 13 s cannot distinguish a slow probe from a warm housing, and the result must show this.

pub(crate) mod compressor;
mod diagnose;
mod fit;
mod held_out;
mod search;
pub(crate) mod side;
mod side_diagnosis;
pub(crate) mod turbine;

pub use diagnose::{SideRequest, diagnose};
pub use side::Side;
pub use side_diagnosis::{Beyond, Diagnosis, HeldOut, SideCause, SideVerdict, Unknown};

use mapper_core::RecordingError;

/// Errors of identification from a log without steps.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum DrivenError {
    #[error(transparent)]
    Channel(#[from] RecordingError),
    /// `until_s`: end of the part that is fitted.
    #[error(
        "the log has {rows} complete rows before {until_s:.1} s, with all driving channels and the machine at work; at least {needed} \
         are needed"
    )]
    TooFewRows { rows: usize, until_s: f64, needed: usize },
    #[error(
        "the recording has {steps} steps with the opening of their valve: `mapper gap diagnose CAMPAIGN RECORDING` diagnoses it; this \
         command is for logs without steps"
    )]
    HasSteps { steps: usize },
    #[error(
        "the model of the campaign's machine has no solution under the readings of this log: check its geometry and the units in the \
         channel map"
    )]
    NoAnswer,
}
