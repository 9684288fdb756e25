//! Inputs and errors of planning, the interface to the identification method, the steady states of the points, and hashes of the inputs, so that a
//! run can detect a changed campaign or model.

use crate::jump_graph::{Rejection, SeparatePoints};
use mapper_core::{
    Jump, Limits, OperatingPoint, PlanInputHashes, Repeats, RigActuators, SettleBands, Timing, VisitOrder,
    WindowRule,
};
pub use mapper_core::{MethodResult, MethodResults};
use mapper_physics::machine::params::BoundaryConditions;
pub use mapper_physics::operating_point::forecast::ForecastRow;
use mapper_physics::operating_point::reach::{FollowOutlet, describe_obstacles, reach};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyState;
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// All inputs of a plan.
#[derive(Debug, Clone)]
pub struct PlanRequest<'a> {
    /// Name of the campaign.
    pub campaign_name: &'a str,
    /// Canonical text of the parsed campaign; the plan stores its hash.
    pub campaign_canonical: &'a str,
    /// The nominal machine.
    pub model: &'a Model,
    /// Nominal boundary conditions. The plan sets P3 and the valve.
    pub boundary: BoundaryConditions,
    /// Boundary temperatures that follow the outlet temperature of each point.
    pub follow_outlet: FollowOutlet,
    /// The points, in listed order.
    pub points: &'a [OperatingPoint],
    /// Criterion of their order.
    pub order: VisitOrder,
    /// Durations.
    pub timing: Timing,
    /// Part of each step in which gradients are predicted.
    pub window: WindowRule,
    /// Criterion for a settled point.
    pub settle_bands: SettleBands,
    /// Limits of every step.
    pub limits: Limits,
    /// Motion of the stand's actuators.
    pub actuators: RigActuators,
    /// Repeated jumps to detect drift.
    pub repeats: Option<Repeats>,
    /// Visits the first point once more at the end, because no jump leads to it at the start.
    pub return_to_first: bool,
    /// An extra jump after all other steps, for example one that a gap diagnosis recommends.
    pub appended: Option<Jump>,
    /// The identification method; `None`: no errors are predicted.
    pub method: Option<&'a dyn PredictedMethod>,
    /// Factor on the duration of the search; 1 is the default, 0 nearly skips it.
    pub effort: f64,
    /// Seed of the search, passed on to simulated rigs.
    pub seed: u64,
}

/// A point that cannot be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreachablePoint {
    /// The point.
    pub point: OperatingPoint,
    /// All limits that it violates, with values and units.
    pub reason: String,
}

/// Failure of planning.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum PlanError {
    #[error("{} of the points cannot be reached: {}", .0.len(), .0.iter().map(|point| format!("{} ({})", point.point, point.reason)).collect::<Vec<_>>().join("; "))]
    Unreachable(Vec<UnreachablePoint>),
    #[error("the campaign has no points; give its grid at least one")]
    NoPoints,
    #[error(
        "a time budget of {:.1} min leaves {dwell_s:.0} s for each of {steps} steps, but a step needs at least {shortest_s:.0} s; allow at \
                 least {:.0} min or remove points",
        budget_s / 60.0,
        (needed_s / 60.0).ceil()
    )]
    BudgetTooShort { budget_s: f64, steps: usize, dwell_s: f64, shortest_s: f64, needed_s: f64 },
    #[error(
        "`required_sigma_eta` needs an identification method that predicts errors; set `identification.method: joint`, or give `timing.dwell`"
    )]
    NoPredictedError,
    /// Every order contains a forbidden jump; `worst`: for each violated limit, the jump that exceeds it most.
    #[error(
        "every order that was tried contains a forbidden jump ({jumps} were found); the worst of each limit: {}; widen the limits or \
         remove points",
        worst.iter().map(|(jump, reason)| format!("{} to {}: {reason}", jump.from, jump.to)).collect::<Vec<_>>().join("; ")
    )]
    NoAdmissibleOrder { jumps: usize, worst: Vec<(Jump, Rejection)> },
    /// No order reaches all points, over other points either.
    #[error(
        "no order within the limits reaches all points; separate from the others are {}; widen the limits, add points between, or remove \
         these points",
        .0.iter().map(SeparatePoints::to_string).collect::<Vec<_>>().join("; ")
    )]
    SeparatePoints(Vec<SeparatePoints>),
    #[error("the forecast of the step to {to} failed: {source}")]
    Forecast { to: OperatingPoint, source: SimulationError },
}

/// An identification method, for planning.
pub trait PredictedMethod: std::fmt::Debug + Sync {
    /// Predicts the result of a single step from the rows of its window, which are `interval_s` apart. `None` if the method has no
    /// result, or if it identifies all steps together.
    fn predict_step(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult>;

    /// Predicts the results of all steps of a campaign, each given from its jump to its end. `None` if the method identifies each
    /// step separately, or if its fit does not converge.
    fn predict_campaign(&self, steps: &[&[ForecastRow]]) -> Option<MethodResults>;

    /// Predicts the reading of conventional mapping at a settled point: apparent efficiency and its standard error, fractions.
    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)>;
}

/// Solves the steady state of each point. The error lists every point that violates a limit, with all violated limits.
pub(crate) fn solve_steady_states(
    request: &PlanRequest<'_>,
    points: &[OperatingPoint],
) -> Result<Vec<SteadyState>, PlanError> {
    let mut unreachable = Vec::new();
    let mut targets = Vec::with_capacity(points.len());
    for &point in points {
        match reach(request.model, point, &request.boundary, request.follow_outlet, &request.limits) {
            Ok(target) => targets.push(target),
            Err(obstacles) => {
                unreachable.push(UnreachablePoint { point, reason: describe_obstacles(&obstacles) })
            }
        }
    }
    if unreachable.is_empty() { Ok(targets) } else { Err(PlanError::Unreachable(unreachable)) }
}

/// SHA-256 of a text, as 64 hexadecimal digits.
pub fn sha256_hex(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().fold(String::with_capacity(64), |mut hex, byte| {
        // Writing to a String cannot fail.
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

/// Hashes the campaign and the nominal machine of `request`.
pub fn hash_inputs(request: &PlanRequest<'_>) -> PlanInputHashes {
    // `Debug` prints every parameter with all digits.
    let model = format!("{:?} {}", request.model.params, request.model.map.fingerprint());
    PlanInputHashes {
        campaign_sha256: sha256_hex(request.campaign_canonical),
        model_sha256: sha256_hex(&model),
        script_sha256: None,
        rig_sha256: None,
    }
}

#[cfg(test)]
mod tests {
    /// FIPS 180-2, appendix B.1.
    #[test]
    fn hashes_the_standards_example() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(super::sha256_hex("abc"), expected);
    }
}
