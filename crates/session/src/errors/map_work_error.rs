//! Why a command on map files ended early.

use mapper_maps::table::DescriptionError;
use mapper_maps::{AssembleError, HeatCorrectionError, MapFitError, TurbineFitError};
use mapper_yaml::keys::KeyError;
use std::path::PathBuf;

/// Errors of commands on map files.
#[derive(Debug, thiserror::Error)]
pub enum MapWorkError {
    /// A map description cannot be read or has mistakes.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// An invalid statement about a map file.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// A compressor map without a fit.
    #[error("{}: {}", .0.display(), .1)]
    NotFitted(PathBuf, #[source] MapFitError),
    /// Compressor maps that cannot be compared.
    #[error(transparent)]
    NotCompared(#[from] MapFitError),
    /// A turbine map without a fit.
    #[error("{}: {}", .0.display(), .1)]
    TurbineNotFitted(PathBuf, #[source] TurbineFitError),
    /// A table whose points are corrected already.
    #[error(
        "{} is not a table of measured points, which has columns for N, flow, P1, T1, P2 and T2 (of a turbine N, flow, P3, T3, P4 and T4); inspect the columns that were recognised",
        .0.display()
    )]
    NotMeasured(PathBuf),
    /// Points that are not a map.
    #[error("{}: {}", .0.display(), .1)]
    NotAssembled(PathBuf, #[source] AssembleError),
    /// A map that cannot be corrected for heat.
    #[error("{}: {}", .0.display(), .1)]
    NotCorrected(PathBuf, #[source] HeatCorrectionError),
    /// A conversion of efficiencies without their definition.
    #[error(
        "the file does not state how its efficiencies are defined; state the definition, e.g. `constant_gamma 1.4`"
    )]
    NoDefinition,
    /// The map of a compressor and that of a turbine.
    #[error("{} is a turbine map, the other file a compressor map; give two maps of the same machine", .0.display())]
    TwoMachines(PathBuf),
    /// A request that turbine maps cannot fulfil, because their quantities are reduced.
    #[error("{} is a turbine map and has no {property}; leave that out", .path.display())]
    NotOfTurbine {
        /// The file.
        path: PathBuf,
        /// The requested property.
        property: &'static str,
    },
    /// A picture that cannot be made.
    #[error("failed to draw the picture: {0}")]
    Picture(String),
}
