//! What a script may do and know: the campaign's points, times and limits, and the nominal machine that judges points.

use mapper_core::OperatingPoint;
use mapper_physics::follow_outlet::{FollowOutlet, hold_speed};
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady::SteadyState;

/// Asks the planner for the order of a set of points; the error is a sentence for people.
pub type OrderPoints = Box<dyn Fn(&[OperatingPoint]) -> Result<Vec<OperatingPoint>, String> + Send>;

/// What no step may leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepLimits {
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
    /// Lowest turbine inlet pressure, Pa.
    pub p3_min_pa: f64,
    /// Highest turbine inlet pressure, Pa.
    pub p3_max_pa: f64,
    /// Highest compressor outlet temperature, K.
    pub t2_max_k: Option<f64>,
    /// Highest turbine inlet temperature, K.
    pub t3_max_k: Option<f64>,
    /// Smallest flow over the surge flow at equal corrected speed, minus one; 0 where none is given.
    pub surge_margin_min_ratio: Option<f64>,
}

/// Relative changes within which a point counts as settled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettleBands {
    /// Shaft speed, ratio.
    pub speed_ratio: f64,
    /// Compressor flow, ratio.
    pub flow_ratio: f64,
    /// Pressure ratio, ratio.
    pub pressure_ratio_ratio: f64,
}

/// Everything a script works with.
pub struct Bench {
    /// The campaign's grid.
    pub points: Vec<OperatingPoint>,
    /// Time at each point where the script says nothing else, s, > 0.
    pub dwell_s: f64,
    /// Time at the first point before its step, s, >= 0.
    pub warm_up_s: f64,
    /// Part of a step over which gradients are forecast, s after the jump; `None`: from settled to the end.
    pub window_s: Option<(f64, f64)>,
    /// When a point counts as settled.
    pub settle_bands: SettleBands,
    /// The nominal machine.
    pub model: Model,
    /// Nominal boundary conditions; P3 and valve are the steps'.
    pub boundary: BoundaryConditions,
    /// What is held at the outlet temperature of each point instead.
    pub follow_outlet: FollowOutlet,
    /// What no step may leave.
    pub limits: StepLimits,
    /// The planner.
    pub order: OrderPoints,
}

/// Why a step is refused.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub message: String,
    pub remedy: String,
}

/// Largest valve opening a rig may be told, relative to the nominal area.
const OPENING_MAX_RATIO: f64 = 2.5;

impl Bench {
    /// The steady state at a point, or why no step may go there.
    pub(crate) fn check(&self, point: OperatingPoint) -> Result<SteadyState, Refusal> {
        let (limits, opening) = (&self.limits, point.valve_opening_ratio);
        let name = format!("{} krpm at opening {opening}", point.speed_rpm / 1e3);
        let refuse = |what: String, remedy: &str| {
            Err(Refusal { message: format!("{name} {what}"), remedy: remedy.to_owned() })
        };
        if !(point.speed_rpm.is_finite() && point.speed_rpm > 0.0) {
            return refuse("has no positive speed".into(), "give a speed such as \"110 krpm\"");
        }
        if point.speed_rpm > limits.speed_max_rpm {
            let what = format!("is above the speed limit of {} krpm", limits.speed_max_rpm / 1e3);
            return refuse(what, "choose a lower speed; the campaign's `limits` hold for scripts as well");
        }
        if !(opening > 0.0 && opening <= OPENING_MAX_RATIO) {
            let what = format!("is outside the valve's range, above 0 to {OPENING_MAX_RATIO}");
            return refuse(what, "choose an opening within the range");
        }
        let boundary = BoundaryConditions { valve_opening_ratio: opening, ..self.boundary };
        let steady = match hold_speed(&self.model, point.speed_rpm, &boundary, self.follow_outlet) {
            Ok(steady) => steady,
            Err(error) => {
                return refuse(format!("cannot be held: {error}"), "choose another speed or opening");
            }
        };
        let t3_k = steady.boundary.t3_k;
        if let Some(limit_k) = limits.t3_max_k.filter(|limit_k| t3_k > *limit_k) {
            let what = format!("has T3 = {:.1} K, above the campaign's limit of {limit_k:.1} K", t3_k);
            return refuse(what, "lower `boundary.turbine_inlet_temperature` of the campaign");
        }
        let p3_pa = steady.boundary.p3_pa;
        if !(limits.p3_min_pa..=limits.p3_max_pa).contains(&p3_pa) {
            let what = format!(
                "needs P3 = {:.1} kPa, outside the limits of {:.1} to {:.1} kPa",
                p3_pa / 1e3,
                limits.p3_min_pa / 1e3,
                limits.p3_max_pa / 1e3
            );
            return refuse(what, "choose a point that the rig's P3 can hold");
        }
        if let Some(limit_k) = limits.t2_max_k.filter(|limit_k| steady.outputs.t2_k > *limit_k) {
            let what = format!(
                "heats the compressor outlet to {:.1} K, above the limit of {limit_k:.1} K",
                steady.outputs.t2_k
            );
            return refuse(what, "choose a lower speed or a larger opening");
        }
        let margin_ratio = self.surge_margin_ratio(point, &steady);
        let least_ratio = limits.surge_margin_min_ratio.unwrap_or(0.0);
        if margin_ratio < least_ratio {
            let what = format!(
                "has a surge margin of {:.1} %, below {:.1} %",
                100.0 * margin_ratio,
                100.0 * least_ratio
            );
            return refuse(what, "choose a larger opening");
        }
        Ok(steady)
    }

    /// Flow over the surge flow at equal corrected speed, minus one.
    fn surge_margin_ratio(&self, point: OperatingPoint, steady: &SteadyState) -> f64 {
        let (reference, boundary) = (self.model.map.reference(), &steady.boundary);
        let corrected_rpm = reference.corrected_speed_rpm(point.speed_rpm, boundary.t1_k);
        let (surge_kg_s, _) = self.model.map.surge_point(corrected_rpm);
        reference.corrected_flow_kg_s(steady.outputs.flow_kg_s, boundary.t1_k, boundary.p1_pa) / surge_kg_s
            - 1.0
    }
}

/// Whether two points are the same on any rig: speeds within 1e-3 rpm, openings within 1e-6.
pub(crate) fn same_place(a: OperatingPoint, b: OperatingPoint) -> bool {
    (a.speed_rpm - b.speed_rpm).abs() < 1e-3 && (a.valve_opening_ratio - b.valve_opening_ratio).abs() < 1e-6
}
