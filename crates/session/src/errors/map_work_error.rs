//! Why a command on map files ended early.

use mapper_maps::table::DescriptionError;
use mapper_maps::{AssembleError, HeatCorrectionError, MapFitError, TurbineFitError};
use mapper_yaml::keys::KeyError;
use std::path::PathBuf;

/// Errors of commands on map files.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum MapWorkError {
    #[error(transparent)]
    Description(#[from] DescriptionError),
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error("{}: {}", .0.display(), .1)]
    NotFitted(PathBuf, #[source] MapFitError),
    #[error(transparent)]
    NotCompared(#[from] MapFitError),
    #[error("{}: {}", .0.display(), .1)]
    TurbineNotFitted(PathBuf, #[source] TurbineFitError),
    /// A table whose points are corrected already.
    #[error(
        "{} is not a table of measured points, which has columns for N, flow, P1, T1, P2 and T2 (of a turbine N, flow, P3, T3, P4 and T4); inspect the columns that were recognised",
        .0.display()
    )]
    NotMeasured(PathBuf),
    #[error("{}: {}", .0.display(), .1)]
    NotAssembled(PathBuf, #[source] AssembleError),
    #[error("{}: {}", .0.display(), .1)]
    NotCorrected(PathBuf, #[source] HeatCorrectionError),
    #[error(
        "the file does not state how its efficiencies are defined; state the definition, e.g. `constant_gamma 1.4`"
    )]
    NoDefinition,
    #[error("{} is a turbine map, the other file a compressor map; give two maps of the same machine", .0.display())]
    TwoMachines(PathBuf),
    #[error("{} is a turbine map and has no {property}; leave that out", .path.display())]
    NotOfTurbine { path: PathBuf, property: &'static str },
    #[error("failed to draw the picture: {0}")]
    Picture(String),
}
