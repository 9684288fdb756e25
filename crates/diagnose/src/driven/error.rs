//! Errors of identification from a log without steps.

use mapper_core::RecordingError;

/// Errors of identification from a log without steps.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DrivenError {
    /// A driving or judged channel is missing.
    #[error(transparent)]
    Channel(#[from] RecordingError),
    /// There are too few rows.
    #[error(
        "the log has {rows} complete rows before {until_s:.1} s, with all driving channels and the machine at work; at least {needed} \
         are needed"
    )]
    TooFewRows {
        /// Complete rows.
        rows: usize,
        /// End of the part that is fitted, s.
        until_s: f64,
        /// Number of rows needed.
        needed: usize,
    },
    /// The nominal machine has no solution.
    #[error(
        "the model of the campaign's machine has no solution under the readings of this log: check its geometry and the units in the \
         channel map"
    )]
    NoAnswer,
}
