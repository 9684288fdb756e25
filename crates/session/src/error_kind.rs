//! Kinds of trouble, by whom or what has to act.

/// What kind of trouble it is: what an exit code or a status page tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file could not be read or written, or the program is at fault.
    Failure,
    /// The campaign or another input has mistakes.
    BadInput,
    /// There is no plan, or the plan given is stale.
    NoPlan,
    /// The rig failed.
    Rig,
    /// The recording does not hold what is needed.
    BadRecording,
    /// Stopped by the operator.
    Interrupted,
}
