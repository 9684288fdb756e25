//! What a plan is made from.

use mapper_core::OperatingPoint;
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::SimulationError;

/// How the order of the points is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisitOrder {
    /// As listed.
    Listed,
    /// Next comes the point whose jump moves the housing most.
    GreedyGradient,
}

/// Durations of a campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanTiming {
    /// At the first point before its step, s, >= 0.
    pub warm_up_s: f64,
    /// At each point, jump included, s, > 0.
    pub dwell_s: f64,
    /// Without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Start of the part of a step over which gradients are counted, s after the jump; `None`: when it has settled.
    pub window_start_s: Option<f64>,
    /// End of that part, s after the jump; `None`: the end of the step.
    pub window_end_s: Option<f64>,
}

/// Bands around the end value within which a point counts as settled, as ratios of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettleBands {
    /// Shaft speed.
    pub speed_ratio: f64,
    /// Compressor flow.
    pub flow_ratio: f64,
    /// Pressure ratio.
    pub pressure_ratio_ratio: f64,
}

/// What no step may leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanLimits {
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
    /// Lowest turbine inlet pressure, Pa.
    pub p3_min_pa: f64,
    /// Highest turbine inlet pressure, Pa.
    pub p3_max_pa: f64,
}

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
    /// The points, in listed order.
    pub points: &'a [OperatingPoint],
    /// How they are ordered.
    pub order: VisitOrder,
    /// Durations.
    pub timing: PlanTiming,
    /// When a point counts as settled.
    pub settle_bands: SettleBands,
    /// What no step may leave.
    pub limits: PlanLimits,
    /// Seed, passed on to simulated rigs.
    pub seed: u64,
}

/// A point that no allowed P3 reaches.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreachablePoint {
    /// The point.
    pub point: OperatingPoint,
    /// Why, with values and units.
    pub reason: String,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// Points that cannot be reached, all of them.
    #[error("{} of the points cannot be reached: {}", .0.len(), .0.iter().map(|point| format!("{} ({})", point.point, point.reason)).collect::<Vec<_>>().join("; "))]
    Unreachable(Vec<UnreachablePoint>),
    /// No points.
    #[error("the campaign has no points; give its grid at least one")]
    NoPoints,
    /// The forecast could not be made.
    #[error("the forecast of the step to {to} failed: {source}")]
    Forecast {
        /// Where the step goes.
        to: OperatingPoint,
        /// Why.
        source: SimulationError,
    },
}
