//! Errors of the kinds of studies.

use mapper_fleet::FleetError;
use std::path::PathBuf;

/// Why a study has no items, or a part no result.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum StudyError {
    #[error("{}: its rig `{backend}` is not simulated; studies run only on backends of this program", .campaign.display())]
    Rig { campaign: PathBuf, backend: String },
    /// A campaign that was checked when the study was made has mistakes now.
    #[error("the campaign of the item has mistakes: {0}")]
    Campaign(String),
    #[error("the item has no file {0}")]
    File(String),
    #[error("the effect library has no effect `{0}`")]
    Cause(String),
    #[error("{name} has the wrong content: {source}")]
    Content { name: String, source: serde_json::Error },
}

impl From<StudyError> for FleetError {
    fn from(error: StudyError) -> Self {
        FleetError::kind(error)
    }
}
