//! Why a log cannot be identified without steps.

use mapper_core::RecordingError;

/// Why a log cannot be identified without steps.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DrivenError {
    /// A channel that drives or is judged is missing.
    #[error(transparent)]
    Channel(#[from] RecordingError),
    /// Too little to find anything from.
    #[error(
        "only {rows} complete rows lie before {until_s:.1} s (speed, flow, P1, P2, T1 and T2 at once, with the compressor working); at \
         least {needed} are needed"
    )]
    TooFewRows {
        /// Complete rows.
        rows: usize,
        /// End of the part that is fitted, s.
        until_s: f64,
        /// How many are needed.
        needed: usize,
    },
    /// The nominal machine has no answer.
    #[error(
        "the campaign's machine gives no temperatures under what drives it in this log: check its geometry, and the units of the \
         channel map"
    )]
    NoAnswer,
}
