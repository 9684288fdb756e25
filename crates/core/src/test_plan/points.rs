//! What a plan is made of: operating points, repeats, dwell, and the order of the visits.

use crate::enums::named_enum;
use crate::text::krpm;
use crate::unit_factors::RPM_PER_KRPM;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Steps of a shown speed in 1 rpm. Bound: the resolution of a rig.
const SHOWN_PER_RPM: f64 = 100.0;
/// Steps of a shown opening in 1. Bound: the resolution of a rig.
const SHOWN_PER_RATIO: f64 = 1e4;
/// Difference of two speeds that are the same on any rig, rpm. Bound: below its resolution.
const SAME_RPM: f64 = 1e-3;
/// Difference of two openings that are the same on any rig. Bound: below its resolution.
const SAME_RATIO: f64 = 1e-6;

/// Start and end of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jump {
    /// The point before the jump.
    pub from: OperatingPoint,
    /// The point after it.
    pub to: OperatingPoint,
}

/// A jump that is repeated to show drift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeats {
    /// The jump. If it is `None`, the jump from the slowest to the fastest point of the middle opening, or the best jump that is allowed.
    pub jump: Option<Jump>,
    /// Maximum number of steps between two repeats, >= 2.
    pub every_steps: usize,
    /// Minimum number of repeats, >= 1.
    pub at_least: usize,
}

/// A point of the measuring grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OperatingPoint {
    /// Target shaft speed, rpm (physical, not corrected).
    pub speed_rpm: f64,
    /// Back-pressure valve opening relative to the nominal area, 0..2.5.
    #[serde(rename = "valve")]
    pub valve_opening_ratio: f64,
}

/// A valve opening for display, in per cent of the valve's nominal area, to a tenth: valves are set to a thousandth at best. `-` if it is unknown.
pub fn valve_area_text(opening_ratio: f64) -> String {
    match opening_ratio.is_finite() {
        true => format!("{} %", (1e3 * opening_ratio).round() / 10.0),
        false => "-".to_owned(),
    }
}

impl OperatingPoint {
    /// Largest setpoint of a back-pressure valve's opening, relative to its nominal area. Bound: a machine chokes before.
    pub const OPENING_MAX_RATIO: f64 = 2.5;

    /// Speed in krpm and opening for display, rounded to the resolution of a rig: 0.01 rpm and 1e-4.
    pub fn shown(&self) -> (f64, f64) {
        (
            (self.speed_rpm * SHOWN_PER_RPM).round() / (SHOWN_PER_RPM * RPM_PER_KRPM),
            (self.valve_opening_ratio * SHOWN_PER_RATIO).round() / SHOWN_PER_RATIO,
        )
    }

    /// Speed to 0.01 krpm and valve area for display: `110 krpm, valve area 70 %`.
    pub fn in_words(&self) -> String {
        let valve = valve_area_text(self.valve_opening_ratio);
        format!("{} krpm, valve area {valve}", krpm(self.speed_rpm))
    }

    /// Whether two points are the same on any rig: speeds within 1e-3 rpm, openings within 1e-6.
    pub fn is_same_place(&self, other: &OperatingPoint) -> bool {
        (self.speed_rpm - other.speed_rpm).abs() < SAME_RPM
            && (self.valve_opening_ratio - other.valve_opening_ratio).abs() < SAME_RATIO
    }
}

impl std::fmt::Display for OperatingPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (krpm, opening) = self.shown();
        write!(f, "{krpm}krpm@{opening}")
    }
}

/// Duration of the steps of a campaign, jump included. All steps have the same duration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dwell {
    /// This duration, s, > 0.
    Fixed(f64),
    /// Fills this total time of warm-up, steps and cool-down, s, > 0.
    TimeBudget(f64),
    /// The shortest duration with this forecast standard error of the efficiencies (rms over the points, fraction, > 0).
    RequiredSigmaEta(f64),
}

impl Dwell {
    /// Usual time at a point, s. Source: two minutes (Burke et al.).
    pub const USUAL_S: f64 = 120.0;

    /// The dwell, s, if the campaign states it; `None` if the planner chooses it.
    pub fn fixed_s(self) -> Option<f64> {
        match self {
            Dwell::Fixed(dwell_s) => Some(dwell_s),
            Dwell::TimeBudget(_) | Dwell::RequiredSigmaEta(_) => None,
        }
    }

    /// The dwell, s, or the usual one until the planner has chosen it.
    pub fn fixed_or_usual_s(self) -> f64 {
        self.fixed_s().unwrap_or(Self::USUAL_S)
    }
}

/// Durations of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Time at the first point before its step begins, s, >= 0.
    pub warm_up_s: f64,
    /// Time without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Time at each point.
    pub dwell: Dwell,
}

named_enum! {
    /// Criterion for the order of the points. Campaigns and plans write it in snake case.
    #[derive(Default, JsonSchema)]
    // The schema is one list of names without descriptions, so that a message can suggest the intended name.
    #[schemars(transform = crate::enums::flatten_to_names)]
    #[schemars(extend("x-removed" = {
        "sum_gradient": "write `order: thermal_gradient`, its new name",
        "min_gradient": "write `order: thermal_gradient`, the default, or one of `speed_lines`, `listed`, `conventional`",
        "worst_gradient": "write `order: thermal_gradient`, the default, or one of `speed_lines`, `listed`, `conventional`",
        "information": "write `order: thermal_gradient`, which needs no more rig time for the same error",
        "time": "write `order: thermal_gradient` with `required_sigma_eta`, which chooses one dwell for all steps",
        "best": "write `order: thermal_gradient`; `mapper plan --compare` shows the other orders",
        "greedy": "write `order: thermal_gradient`, which looks at the whole order",
    }))]
    pub enum VisitOrder {
        /// Largest sum of the housing's temperature changes within the windows (Burke et al., figure 13 b).
        #[default]
        ThermalGradient = "thermal_gradient",
        /// By speed, on each line from the widest valve opening to the narrowest (Burke et al., figure 13 a).
        SpeedLines = "speed_lines",
        /// The order of the grid.
        Listed = "listed",
        /// As `speed_lines`, but each step lasts until T2 and the housing no longer drift: conventional mapping, for comparison.
        Conventional = "conventional",
    }
}
