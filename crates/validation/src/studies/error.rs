//! What only a kind finds wrong.

use mapper_fleet::FleetError;
use std::path::PathBuf;

/// Why a study has no items, or a part no result.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The rig of a campaign is not simulated.
    #[error("{}: its rig `{backend}` is not simulated; studies run on backends of this program alone", .campaign.display())]
    Rig {
        /// The campaign.
        campaign: PathBuf,
        /// Its backend.
        backend: String,
    },
    /// A campaign that was checked when the study was made has mistakes now.
    #[error("the campaign of the item has mistakes: {0}")]
    Campaign(String),
    /// An item asks for what the campaign may not name.
    #[error("the item has no file {0}")]
    File(String),
    /// A cause that the program does not know.
    #[error("no effect `{0}` is in the catalogue")]
    Cause(String),
    /// A part or an item does not hold what its kind writes.
    #[error("{name} does not hold what it should: {source}")]
    Content {
        /// The item.
        name: String,
        /// Why.
        source: serde_json::Error,
    },
}

impl From<StudyError> for FleetError {
    fn from(error: StudyError) -> Self {
        FleetError::kind(error)
    }
}
