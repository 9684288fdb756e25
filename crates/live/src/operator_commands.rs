//! Commands of the operator's buttons.

/// Command of a button.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OperatorCommand {
    /// Hold the current step.
    Hold,
    /// Continue after a hold.
    Continue,
    /// Stop the run at the end of the step.
    StopAfterStep,
    /// Go to the safe state now.
    SafeNow,
}
