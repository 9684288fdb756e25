//! The inputs of a sequence: the campaign's points, times and limits, and the nominal machine that checks points.

use mapper_core::{Limits, OperatingPoint, SettleBands, Timing, WindowRule};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::follow_outlet::FollowOutlet;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::SteadyState;

/// Asks the planner for the order of a set of points; the error is a sentence.
pub type OrderPoints = Box<dyn Fn(&[OperatingPoint]) -> Result<Vec<OperatingPoint>, String> + Send>;

/// All inputs of a sequence except its script.
pub struct SequenceRequest {
    /// The campaign's grid.
    pub points: Vec<OperatingPoint>,
    /// Durations; the dwell applies unless the script sets its own.
    pub timing: Timing,
    /// Part of a step over which gradients are predicted.
    pub window: WindowRule,
    /// Criterion for a settled point.
    pub settle_bands: SettleBands,
    /// The nominal machine.
    pub model: Model,
    /// Nominal boundary conditions; each step has its own P3 and valve opening.
    pub boundary: BoundaryConditions,
    /// Boundary temperatures that follow the compressor outlet temperature of each point.
    pub follow_outlet: FollowOutlet,
    /// Limits of every step.
    pub limits: Limits,
    /// The planner.
    pub order: OrderPoints,
}

/// Refusal of a step.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub message: String,
    pub remedy: String,
}

impl SequenceRequest {
    /// Solves the steady state of a point, or refuses it because it violates a limit.
    pub(crate) fn check(&self, point: OperatingPoint) -> Result<SteadyState, Refusal> {
        reach(&self.model, point, &self.boundary, self.follow_outlet, &self.limits).map_err(|obstacles| {
            let (krpm, opening) = (point.speed_rpm / 1e3, point.valve_opening_ratio);
            Refusal {
                message: format!("{krpm} krpm at opening {opening} {}", describe_obstacles(&obstacles)),
                remedy: obstacles.first().map_or("", |obstacle| obstacle.remedy()).to_owned(),
            }
        })
    }
}
