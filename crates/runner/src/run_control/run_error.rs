//! Errors of a run.

use crate::run_control::observer::ObserverError;
use crate::step_sources::step_source::StepSourceError;
use mapper_core::BackendError;

/// Failure of a run. The rig was commanded to its safe state before this is returned.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum RunError {
    #[error("the rig could not be armed, and no step was started: {0}")]
    NotArmed(#[source] BackendError),
    #[error("the rig failed: {0}")]
    Backend(#[from] BackendError),
    #[error("{0}")]
    Observer(#[from] ObserverError),
    #[error("{0}")]
    Source(#[from] StepSourceError),
    #[error(
        "the program failed during the run ({message}); the rig is safe. Please report this as a fault of the program"
    )]
    Panicked { message: String },
    #[error(
        "THE RIG DID NOT CONFIRM ITS SAFE STATE: {source}. Cut its air by hand. The run had ended because: {why}"
    )]
    NotSafe { why: String, source: BackendError },
}

impl RunError {
    /// Whether the state of the rig is unknown.
    pub fn leaves_rig_state_unknown(&self) -> bool {
        match self {
            RunError::NotSafe { .. } | RunError::Panicked { .. } => true,
            RunError::Backend(error) => {
                matches!(error, BackendError::Lost { .. } | BackendError::Deadline { .. })
            }
            // A rig that does not answer may still arm later.
            RunError::NotArmed(error) => matches!(error, BackendError::Deadline { .. }),
            RunError::Observer(_) | RunError::Source(_) => false,
        }
    }
}
