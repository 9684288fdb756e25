//! Errors of the reproduction.

use mapper_identify::{IdentifyError, StepError};
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyError;

/// Why a figure could not be reproduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ReproduceError {
    #[error(transparent)]
    Steady(#[from] SteadyError),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A step has no point.
    #[error(transparent)]
    Step(#[from] StepError),
    #[error("a simulated run has no step or no sample in the window")]
    NoStep,
}
