//! Why a command on map files ended early.

use mapper_maps::table::{DescriptionError, KeyError};
use mapper_maps::{AssembleError, HeatCorrectionError, MapFitError, TurbineFitError};
use std::path::PathBuf;

/// Errors of commands on map files.
#[derive(Debug, thiserror::Error)]
pub enum MapWorkError {
    /// A map description cannot be read or has mistakes.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A statement about a map file that is none.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// A compressor map without a fit.
    #[error("{}: {source}", .path.display())]
    NotFitted {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: MapFitError,
    },
    /// Compressor maps that cannot be compared.
    #[error(transparent)]
    NotCompared(#[from] MapFitError),
    /// A turbine map without a fit.
    #[error("{}: {source}", .path.display())]
    TurbineNotFitted {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: TurbineFitError,
    },
    /// A table whose points are corrected already.
    #[error(
        "{} is not a table of measured points, which has N, flow, P1, T1, P2 and T2; the columns that were found are shown by `mapper map inspect`",
        .path.display()
    )]
    NotMeasured {
        /// The file.
        path: PathBuf,
    },
    /// Points that are not a map.
    #[error("{}: {source}", .path.display())]
    NotAssembled {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: AssembleError,
    },
    /// A map that cannot be corrected for heat.
    #[error("{}: {source}", .path.display())]
    NotCorrected {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: HeatCorrectionError,
    },
    /// A conversion of efficiencies without their definition.
    #[error(
        "the file does not name the definition of its efficiencies: give it by `--efficiency`, e.g. `--efficiency \"constant_gamma 1.4\"`"
    )]
    NoDefinition,
    /// The map of a compressor and that of a turbine.
    #[error("{} is the map of a turbine, the other file that of a compressor; give two maps of the same machine", .turbine.display())]
    TwoMachines {
        /// The file of the turbine.
        turbine: PathBuf,
    },
    /// An option that turbine maps do not have.
    #[error("{} is the map of a turbine: its quantities are reduced, so `{option}` has no meaning; leave it out", .path.display())]
    NotOfTurbine {
        /// The file.
        path: PathBuf,
        /// The option.
        option: &'static str,
    },
    /// A picture that cannot be made.
    #[error("failed to draw the picture: {problem}")]
    Picture {
        /// The problem.
        problem: String,
    },
}
