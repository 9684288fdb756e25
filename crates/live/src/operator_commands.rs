//! The operator's buttons.

/// What a button asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pressed {
    /// Stay at this step.
    Hold,
    /// Let it end.
    GoOn,
    /// Stop the run at the end of the step.
    StopAfterStep,
    /// Into the safe state, now.
    SafeNow,
}
