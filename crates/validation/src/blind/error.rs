//! Errors of blind cases.

use mapper_campaign::NominalTableError;
use mapper_physics::rig::effect::EffectError;
use mapper_physics::simulation::steady::SteadyError;
use mapper_recording::RecordError;
use mapper_runner::RunError;
use std::path::PathBuf;

/// Errors when cases are created or scored.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum BlindError {
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("{} does not contain {what}: {source}", path.display())]
    Content { path: PathBuf, what: &'static str, source: serde_json::Error },
    #[error("{} is larger than {limit} bytes, the maximum of its kind", path.display())]
    TooLarge { path: PathBuf, limit: u64 },
    #[error(
        "{} has SHA-256 {actual}, but {expected} was printed when the cases were made: the answers have been changed",
        path.display()
    )]
    Seal { path: PathBuf, actual: String, expected: String },
    /// The lab stopped, or its data cannot be stored.
    #[error("case {name}: {source}")]
    Run { name: String, source: RunError },
    /// A point of the campaign that the nominal model cannot hold.
    #[error(transparent)]
    Point(#[from] SteadyError),
    /// An effect cannot be applied: a defect of the draw.
    #[error(transparent)]
    Effect(#[from] EffectError),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    NominalModel(#[from] NominalTableError),
    #[error("failed to measure signatures: {source}")]
    Signatures { source: Box<dyn std::error::Error + Send + Sync> },
    #[error("{cases} cases were requested; 1 to {max} are allowed")]
    Cases { cases: usize, max: usize },
}

impl BlindError {
    pub(crate) fn signatures(source: impl std::error::Error + Send + Sync + 'static) -> Self {
        BlindError::Signatures { source: Box::new(source) }
    }

    pub(crate) fn file(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| BlindError::File { path, source }
    }
}
