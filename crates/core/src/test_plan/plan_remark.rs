//! Remarks on a plan, and the forecast of its verdicts.

use crate::enums::coded_enum;
use crate::{Channel, GuardName, OperatingPoint};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

coded_enum! {
/// A remark for the operator of a plan, by its stable code.
PlanRemark {
    /// A jump is repeated to detect drift.
    "repeated_jump" RepeatedJump { from: OperatingPoint, to: OperatingPoint, times: usize },
    /// No jump can be repeated, so that drift cannot be detected.
    "no_repeated_jump" NoRepeatedJump,
    /// A jump follows all other steps, and is not a point of the map.
    "appended_jump" AppendedJump { from: OperatingPoint, to: OperatingPoint },
    /// A limit forbids the jump; the plan leads over these points instead, which it visits again.
    "way_around" WayAround { from: OperatingPoint, to: OperatingPoint, over: Vec<OperatingPoint> },
    /// The first point is visited again at the end.
    "first_point_again" FirstPointAgain { point: OperatingPoint },
    /// No jump leads to the first point, so that it has no transient.
    "first_point_without_jump" FirstPointWithoutJump { point: OperatingPoint },
    /// A limit forbids the return to the first point.
    "no_way_back" NoWayBack,
    /// The points will have the warning of this code: the error without declared uncertainties, and the largest permitted one.
    "prior_dominated" PriorDominated { eta_error: f64, max_eta_error: f64 },
    /// The longest dwell does not reach the required error.
    "required_error_not_reached" RequiredErrorNotReached { dwell_s: f64, eta_sigma: f64, required_eta_sigma: f64 },
    /// The search for surge after the steps.
    "surge_search" SurgeSearch { lines: usize, closest_margin_ratio: f64, steps: usize, duration_s: f64 },
    /// A guard ends the rehearsal on the nominal machine in the step to this point: its report, and the highest speed of all steps if the
    /// guard is that of the speed.
    "guard_trip" GuardTrip { guard: GuardName, to: OperatingPoint, reason: String, highest_speed_rpm: Option<f64> },
    /// The slowest crossing of the speeds to avoid, in the step with this number from 1.
    "avoided_crossing" AvoidedCrossing { step: usize, from_rpm: f64, to_rpm: f64, inside_s: f64, longest_s: f64 },
    /// Offsets that remain after the soak, in the channels' units, and those after a longer soak that would clearly reduce them.
    "offsets_after_soak" OffsetsAfterSoak {
        soak_s: f64, offset_sigmas: BTreeMap<Channel, f64>, longer_soak_s: f64, longer_offset_sigmas: BTreeMap<Channel, f64>
    },
}
}

/// Reads the remarks of a plan; those of older plans are sentences.
pub(crate) fn deserialize_remarks<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<PlanRemark>, D::Error> {
    let stored = Vec::<Value>::deserialize(deserializer)?;
    let read = |remark: Value| match remark {
        Value::String(message) => Ok(PlanRemark::Other { code: "sentence".to_owned(), message }),
        typed => serde_json::from_value(typed).map_err(serde::de::Error::custom),
    };
    stored.into_iter().map(read).collect()
}

/// Expected verdicts of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VerdictForecast {
    /// Points that the campaign measures.
    pub points: usize,
    /// Points with the expected verdict `good`.
    pub good: usize,
    /// Points that are good even if the errors are larger than expected.
    pub good_low: usize,
    /// Points that are good if the errors are smaller than expected.
    pub good_high: usize,
    /// Whether the steps may contain too little information to check the declared parameters, which would make all points doubtful.
    pub near_limit: bool,
    /// Expected standard error of efficiency, root mean square over the points, fraction; `None` if the steps cannot check the declared parameters.
    pub eta_standard_error: Option<f64>,
    /// Expectation for a machine that is not as declared; `None` if nothing is searched for, or nothing can be determined.
    pub undeclared: Option<UndeclaredForecast>,
    /// Rig time, s.
    pub duration_s: f64,
}

/// Expected verdicts if alpha_A, probe and heating/cooling ratio differ from the declaration by one standard deviation of such machines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UndeclaredForecast {
    /// Points with the expected verdict `good`.
    pub good: usize,
    /// Expected standard error of efficiency, root mean square over the points, fraction.
    pub eta_standard_error: f64,
}

/// A change of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CampaignChange {
    /// `timing.dwell`, s.
    DwellS(f64),
    /// `zero.soak`, s.
    SoakS(f64),
}

/// A change of the campaign with the verdicts expected after it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Advice {
    /// The change.
    pub change: CampaignChange,
    /// Verdicts after the change.
    pub forecast: VerdictForecast,
}
