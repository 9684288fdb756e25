//! Errors of FMU export.

use mapper_fmu::FmuError;
use mapper_physics::compressor_map::tabulated_map::MapError;
use mapper_physics::simulation::steady::SteadyError;

/// Why a machine cannot be written as an FMU.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FmuExportError {
    #[error("an FMU needs a map of the whole machine: {0}")]
    NoMap(String),
    #[error("the map cannot be simulated: {0}")]
    Map(#[from] MapError),
    #[error("the model has no steady state to start from: {0}")]
    Start(#[from] SteadyError),
    #[error(transparent)]
    Fmu(#[from] FmuError),
    #[error(
        "FMI 2.0 has no name for libraries of this platform; export the sources only and let the importer compile them"
    )]
    Platform,
    #[error(
        "the sources cannot be compiled with `{compiler}`: {why}; install a C compiler, name it in CC, or export the sources only"
    )]
    Compiler { compiler: String, why: String },
}
