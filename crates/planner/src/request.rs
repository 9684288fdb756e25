//! What a plan is made from.

use crate::method::PredictedMethod;
use mapper_core::{Jump, Limits, OperatingPoint, Repeats, SettleBands, Timing, VisitOrder, WindowRule};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::follow_outlet::FollowOutlet;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::SimulationError;

/// Everything a plan depends on.
#[derive(Debug, Clone)]
pub struct PlanRequest<'a> {
    /// Name of the campaign.
    pub campaign_name: &'a str,
    /// The campaign as the program understood it, as text; hashed.
    pub campaign_canonical: &'a str,
    /// The nominal machine.
    pub model: &'a Model,
    /// Nominal boundary conditions; P3 and valve are the plan's.
    pub boundary: BoundaryConditions,
    /// What is held at the outlet temperature of each point instead.
    pub follow_outlet: FollowOutlet,
    /// The points, in listed order.
    pub points: &'a [OperatingPoint],
    /// How they are ordered.
    pub order: VisitOrder,
    /// Durations.
    pub timing: Timing,
    /// Part of each step over which gradients are counted.
    pub window: WindowRule,
    /// When a point counts as settled.
    pub settle_bands: SettleBands,
    /// What no step may leave.
    pub limits: Limits,
    /// Repeats for drift, if any.
    pub repeats: Option<Repeats>,
    /// Whether the first point, which no jump leads to, is visited once more at the end.
    pub return_to_first: bool,
    /// A jump to be made after all else, e.g. one that a gap diagnosis asks for.
    pub appended: Option<Jump>,
    /// The identification method; without one no errors are predicted.
    pub method: Option<&'a dyn PredictedMethod>,
    /// Work of the search, 1 for the usual; larger searches longer, 0 hardly at all.
    pub effort: f64,
    /// Whether to work out how good an order can be at all.
    pub bound: bool,
    /// Seed of the search, passed on to simulated rigs.
    pub seed: u64,
}

/// A point that cannot be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreachablePoint {
    /// The point.
    pub point: OperatingPoint,
    /// Why, with values and units: all limits that are in its way.
    pub reason: String,
}

/// Why planning fails.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// Points that cannot be reached, all of them.
    #[error("{} of the points cannot be reached: {}", .0.len(), .0.iter().map(|point| format!("{} ({})", point.point, point.reason)).collect::<Vec<_>>().join("; "))]
    Unreachable(Vec<UnreachablePoint>),
    /// No points.
    #[error("the campaign has no points; give its grid at least one")]
    NoPoints,
    /// The time budget leaves too little time at each point.
    #[error(
        "a time budget of {:.1} min leaves {dwell_s:.0} s for each of {steps} steps, and a step needs {shortest_s:.0} s; allow {:.0} min or more, or \
         leave points out",
        budget_s / 60.0,
        (needed_s / 60.0).ceil()
    )]
    BudgetTooShort {
        /// The budget, s.
        budget_s: f64,
        /// Steps of the plan.
        steps: usize,
        /// Time for each of them, s.
        dwell_s: f64,
        /// Shortest dwell that is chosen, s.
        shortest_s: f64,
        /// Budget for that dwell, s.
        needed_s: f64,
    },
    /// A dwell cannot be chosen by an error that no method predicts.
    #[error(
        "`required_sigma_eta` needs an identification method that predicts errors; set `identification.method: joint`, or give `timing.dwell`"
    )]
    NoPredictedError,
    /// No order of the points avoids jumps that are not allowed.
    #[error(
        "no order was found that avoids every forbidden jump: {}; widen the limits or leave points out",
        .0.join("; ")
    )]
    NoAdmissibleOrder(Vec<String>),
    /// The forecast could not be made.
    #[error("the forecast of the step to {to} failed: {source}")]
    Forecast {
        /// Destination of the step.
        to: OperatingPoint,
        /// Why.
        source: SimulationError,
    },
}
