//! Errors of the nominal map of a first campaign.

use mapper_campaign::NominalTableError;
use std::path::PathBuf;

/// Why a first campaign cannot get its nominal map.
#[derive(Debug, thiserror::Error)]
pub enum FirstMapError {
    /// It is not a map.
    #[error(
        "the file {} is not a map: {source}; write a table with corrected speed, corrected flow, pressure ratio and efficiency, with \
         units in its heading, or convert it with `mapper map convert`", .path.display()
    )]
    NotAMap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: NominalTableError,
    },
    /// The speed range does not overlap with the map.
    #[error(
        "the speeds {:.1} to {:.1} krpm leave no line of the map, which has {:.1} to {:.1} krpm; choose speeds within it",
        .asked_rpm.0 / 1e3, .asked_rpm.1 / 1e3, .map_rpm.0 / 1e3, .map_rpm.1 / 1e3
    )]
    NoLines {
        /// The speeds asked for, rpm.
        asked_rpm: (f64, f64),
        /// The lowest and highest line of the map, rpm.
        map_rpm: (f64, f64),
    },
}
