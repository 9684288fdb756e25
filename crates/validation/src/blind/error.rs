//! Errors of blind cases.

use mapper_campaign::NominalTableError;
use mapper_physics::rig::effect::EffectError;
use mapper_physics::simulation::steady::SteadyError;
use mapper_recording::RecordError;
use mapper_runner::RunError;
use std::path::PathBuf;

/// Errors when cases are created or scored.
#[derive(Debug, thiserror::Error)]
pub enum BlindError {
    /// A file or directory cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A file has the wrong content.
    #[error("{} does not contain {what}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The expected content.
        what: &'static str,
        /// The cause.
        source: serde_json::Error,
    },
    /// A file is larger than any of its kind.
    #[error("{} is larger than {limit} bytes, the maximum of its kind", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Maximum size, bytes.
        limit: u64,
    },
    /// The answers are not those that were sealed.
    #[error(
        "{} has SHA-256 {actual}, but {expected} was printed when the cases were made: the answers have been changed",
        path.display()
    )]
    Seal {
        /// The file of answers.
        path: PathBuf,
        /// Its current hash.
        actual: String,
        /// The sealed hash.
        expected: String,
    },
    /// The lab stopped, or its data cannot be stored.
    #[error("case {name}: {source}")]
    Run {
        /// The case.
        name: String,
        /// The cause.
        source: RunError,
    },
    /// A point of the campaign that the nominal model cannot hold.
    #[error(transparent)]
    Point(#[from] SteadyError),
    /// An effect cannot be applied: a defect of the draw.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// A recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The campaign's map gives no nominal model.
    #[error(transparent)]
    NominalModel(#[from] NominalTableError),
    /// No channel of the campaign's recording can be compared with the model.
    #[error("the recording has no channel for signatures; declare sensors of speed, P2, T2 or Tc")]
    NothingRecorded,
    /// The diagnosis that measures signatures, or its calibration, failed.
    #[error("failed to measure signatures: {source}")]
    Signatures {
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Too many cases.
    #[error("{cases} cases were requested; 1 to {max} are allowed")]
    Cases {
        /// The requested number.
        cases: usize,
        /// Maximum number in one directory.
        max: usize,
    },
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
