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
    #[error("the map is none that a model can run on: {0}")]
    Map(#[from] MapError),
    /// The model has no steady start point.
    #[error("there is no steady state to begin at: {0}")]
    Start(#[from] SteadyError),
    /// The archive cannot be made.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The compiler is missing or fails.
    #[error("the sources cannot be compiled with `{compiler}`: {why}")]
    Compiler {
        /// The compiler command.
        compiler: String,
        /// The compiler's output.
        why: String,
    },
}
