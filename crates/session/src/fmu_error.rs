//! Why a machine is no FMU.

use mapper_fmu::FmuError;
use mapper_physics::steady::SteadyError;
use mapper_physics::tabulated_map::MapError;

/// Why a machine is no FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuExportError {
    /// The recording gives no map of enough lines.
    #[error("an FMU needs a map of the whole machine: {0}")]
    NoMap(String),
    /// The map is none that a model can run on.
    #[error("the map is none that a model can run on: {0}")]
    Map(#[from] MapError),
    /// It has nowhere to begin.
    #[error("there is no steady state to begin at: {0}")]
    Start(#[from] SteadyError),
    /// The archive cannot be made.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// No compiler, or one that refuses.
    #[error("the sources cannot be compiled with `{compiler}`: {why}")]
    Compiler {
        /// The program that was called.
        compiler: String,
        /// What it said.
        why: String,
    },
}
