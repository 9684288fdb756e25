//! Errors of the nominal map of a first campaign.

use mapper_campaign::{MapMisfit, NominalTableError, USUAL_WHEEL_DIAMETERS_M};
use std::path::PathBuf;

/// Why a first campaign cannot get its nominal map.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FirstMapError {
    #[error(
        "a compressor wheel of {} mm is unusual: turbochargers have {:.0} to {:.0} mm; give its diameter at the exit, with its unit",
        (1e7 * .wheel_m).round() / 1e4, 1e3 * USUAL_WHEEL_DIAMETERS_M.0, 1e3 * USUAL_WHEEL_DIAMETERS_M.1
    )]
    Wheel { wheel_m: f64 },
    #[error(
        "the file {} is not a map: {}; write a table of corrected speed, corrected flow, pressure ratio and efficiency, with units \
         in its header, or convert a map of another format", .0.display(), .1
    )]
    NotAMap(PathBuf, #[source] NominalTableError),
    #[error("the map {}: {misfit}; {}", .path.display(), .misfit.remedy())]
    Misfit { path: PathBuf, misfit: MapMisfit },
    #[error(
        "the map has no speed line between {:.1} and {:.1} krpm; choose speeds between {:.1} and {:.1} krpm",
        .requested_rpm.0 / 1e3, .requested_rpm.1 / 1e3, .map_rpm.0 / 1e3, .map_rpm.1 / 1e3
    )]
    NoLines { requested_rpm: (f64, f64), map_rpm: (f64, f64) },
}
