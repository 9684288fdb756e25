//! What a plan is made from.

use crate::method::PredictedMethod;
use mapper_core::OperatingPoint;
use mapper_physics::follow_outlet::FollowOutlet;
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
    /// Largest sum of the housing's temperature changes within the windows.
    SumGradient,
    /// Largest smallest change.
    WorstGradient,
    /// Smallest mean square of predicted standard error and bias of the efficiency.
    Information,
    /// Shortest campaign whose points reach a required standard error; the dwell is chosen for each step.
    Time,
}

impl VisitOrder {
    /// Name in plans.
    pub fn name(self) -> &'static str {
        match self {
            VisitOrder::Listed => "listed",
            VisitOrder::GreedyGradient => "greedy_gradient",
            VisitOrder::SumGradient => "sum_gradient",
            VisitOrder::WorstGradient => "worst_gradient",
            VisitOrder::Information => "information",
            VisitOrder::Time => "time",
        }
    }
}

/// Durations of a campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanTiming {
    /// At the first point before its step, s, >= 0.
    pub warm_up_s: f64,
    /// At each point, jump included, s, > 0; with [`VisitOrder::Time`] the longest.
    pub dwell_s: f64,
    /// Without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Start of the part of a step over which gradients are counted, s after the jump; `None`: when it has settled.
    pub window_start_s: Option<f64>,
    /// End of that part, s after the jump; `None`: the end of the step.
    pub window_end_s: Option<f64>,
}

/// Variations within a window up to which a point counts as settled, as ratios of the mean.
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
    /// Highest turbine inlet temperature, K.
    pub t3_max_k: Option<f64>,
    /// Highest compressor outlet temperature, K; also on the way.
    pub t2_max_k: Option<f64>,
    /// Smallest surge margin of a point: flow over the surge flow at equal corrected speed, minus one.
    pub surge_margin_min_ratio: Option<f64>,
    /// Longest time that a jump may spend beyond the surge line, s.
    pub surge_allowed_s: f64,
    /// Largest change of the compressor housing within a window, K.
    pub housing_gradient_max_k: Option<f64>,
    /// Fastest change of the turbine inlet pressure that the rig can make, Pa/s.
    pub p3_slew_max_pa_s: Option<f64>,
}

/// A jump that is made again and again, so that drift shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeats {
    /// Where it starts and where it goes; `None`: from the slowest to the fastest point of the middle opening, or the
    /// next best jump that is allowed.
    pub jump: Option<(OperatingPoint, OperatingPoint)>,
    /// Steps between two of them, > 0.
    pub every_steps: usize,
    /// Fewest of them.
    pub at_least: usize,
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
    /// What is held at the outlet temperature of each point instead.
    pub follow_outlet: FollowOutlet,
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
    /// Repeats for drift, if any.
    pub repeats: Option<Repeats>,
    /// A jump to be made after all else, by its start and its target, e.g. what a gap diagnosis asks for.
    pub appended: Option<(OperatingPoint, OperatingPoint)>,
    /// Standard error of the efficiency (fraction) that [`VisitOrder::Time`] has to reach.
    pub required_sigma_eta: Option<f64>,
    /// The identification method; without one no errors are predicted.
    pub method: Option<&'a dyn PredictedMethod>,
    /// Work of the search, 1 for the usual; larger searches longer, 0 hardly at all.
    pub effort: f64,
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

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// Points that cannot be reached, all of them.
    #[error("{} of the points cannot be reached: {}", .0.len(), .0.iter().map(|point| format!("{} ({})", point.point, point.reason)).collect::<Vec<_>>().join("; "))]
    Unreachable(Vec<UnreachablePoint>),
    /// No points.
    #[error("the campaign has no points; give its grid at least one")]
    NoPoints,
    /// An order needs to know what the identification will make of a step.
    #[error(
        "the order {order} needs the dynamic identification method; set `identification.method: dynamic`"
    )]
    NeedsMethod {
        /// The order.
        order: &'static str,
    },
    /// The shortest campaign for what?
    #[error("the order time needs the standard error to reach; set `required_sigma_eta`, e.g. `0.5 %`")]
    NeedsRequiredError,
    /// No order of the points avoids jumps that are not allowed.
    #[error(
        "no order was found that avoids every jump that is not allowed: {}; widen the limits or leave points out",
        .0.join("; ")
    )]
    NoAdmissibleOrder(Vec<String>),
    /// The forecast could not be made.
    #[error("the forecast of the step to {to} failed: {source}")]
    Forecast {
        /// Where the step goes.
        to: OperatingPoint,
        /// Why.
        source: SimulationError,
    },
}
