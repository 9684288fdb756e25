//! Error categories by the necessary action.

/// Category of an error, for exit codes and status pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file could not be read or written, or the program has a defect.
    Failure,
    /// The campaign or another input has mistakes.
    BadInput,
    /// No plan is possible, or the given plan is stale.
    NoPlan,
    /// The rig failed.
    Rig,
    /// The recording does not contain the required data.
    BadRecording,
    /// Stopped by the operator.
    Interrupted,
}
