//! Errors of FMU export.

use mapper_fmu::FmuError;
use mapper_physics::compressor_map::tabulated_map::MapError;
use mapper_physics::simulation::steady::SteadyError;

/// Why a machine cannot be written as an FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuExportError {
    /// The recording gives too few map lines.
    #[error("an FMU needs a map of the whole machine: {0}")]
    NoMap(String),
    /// The map cannot be used for simulation.
    #[error("the map cannot be simulated: {0}")]
    Map(#[from] MapError),
    /// The model has no steady start point.
    #[error("the model has no steady state to start from: {0}")]
    Start(#[from] SteadyError),
    /// The archive cannot be made.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// FMI has no name for this platform.
    #[error(
        "FMI 2.0 has no name for libraries of this platform; export the sources only and let the importer compile them"
    )]
    Platform,
    /// The compiler is missing or fails.
    #[error(
        "the sources cannot be compiled with `{compiler}`: {why}; install a C compiler, name it in CC, or export the sources only"
    )]
    Compiler {
        /// The compiler command.
        compiler: String,
        /// The compiler's output.
        why: String,
    },
}
