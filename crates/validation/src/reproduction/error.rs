//! Errors of the reproduction.

use mapper_identify::{IdentifyError, StepError};
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyError;

/// Why a figure could not be reproduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReproduceError {
    /// A steady state does not exist.
    #[error(transparent)]
    Steady(#[from] SteadyError),
    /// The model could not be integrated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The recording could not be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A step has no point.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A run has no step, or no sample in the window.
    #[error("a simulated run has no step or no sample in the window")]
    NoStep,
}
