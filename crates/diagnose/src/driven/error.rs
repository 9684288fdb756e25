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
        "only {rows} complete rows lie before {until_s:.1} s (speed, flow, P1, P2, T1 and T2 at once, with the compressor working); at \
         least {needed} are needed"
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
        "the campaign's machine gives no temperatures under what drives it in this log: check its geometry, and the units of the \
         channel map"
    )]
    NoAnswer,
}
