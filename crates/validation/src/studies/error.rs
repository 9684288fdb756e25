//! Errors of the kinds of studies.

use mapper_fleet::FleetError;
use std::path::PathBuf;

/// Why a study has no items, or a part no result.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The rig of a campaign is not simulated.
    #[error("{}: its rig `{backend}` is not simulated; studies run only on backends of this program", .campaign.display())]
    Rig {
        /// The campaign.
        campaign: PathBuf,
        /// Its backend.
        backend: String,
    },
    /// A campaign that was checked when the study was made has mistakes now.
    #[error("the campaign of the item has mistakes: {0}")]
    Campaign(String),
    /// An item requests something that its campaign may not use.
    #[error("the item has no file {0}")]
    File(String),
    /// A cause that the program does not know.
    #[error("the effect library has no effect `{0}`")]
    Cause(String),
    /// A part or an item has the wrong content for its kind.
    #[error("{name} has the wrong content: {source}")]
    Content {
        /// The item.
        name: String,
        /// The cause.
        source: serde_json::Error,
    },
}

impl From<StudyError> for FleetError {
    fn from(error: StudyError) -> Self {
        FleetError::kind(error)
    }
}
