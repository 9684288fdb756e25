//! A plan: its steps with transitions and expected results, its remarks, and the forecast of its verdicts.

use crate::enums::coded_enum;
use crate::unit_factors::S_PER_MIN;
use crate::{AvoidedCrossing, AvoidedRange, Channel, GuardName, OperatingPoint, RigActuators, step_number};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Whether a step measures a point for the map or revisits one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepKind {
    /// A point of the grid.
    #[default]
    Point,
    /// A revisit, to detect drift.
    Repeat,
    /// Second visit of the first point at the end, because no jump leads to it at the start.
    Return,
    /// A step of an approach to the surge line, after all others.
    Approach,
}

impl StepKind {
    /// Whether the step measures a point for the map; a repeat serves only for comparison.
    pub fn measures(self) -> bool {
        match self {
            StepKind::Point | StepKind::Return => true,
            StepKind::Repeat | StepKind::Approach => false,
        }
    }
}

/// Results of a step expected from the nominal model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Predicted {
    /// Change of T2 over the identification window, K (signed). `None` for the first step, which has no jump.
    pub dt2_k: Option<f64>,
    /// Change of the compressor housing temperature over the window, K (signed).
    pub dtc_k: Option<f64>,
    /// Standard error of the efficiency (fraction); `None` if it was not forecast.
    pub sigma_eta: Option<f64>,
    /// Standard error of the efficiency that the identification will report (fraction): it includes values of alpha_A, probe and
    /// heating/cooling ratio that the recording cannot exclude. `None` if it was not forecast.
    #[serde(default)]
    pub reported_sigma_eta: Option<f64>,
    /// The same if these parameters differ from the declaration by one standard deviation of such machines.
    #[serde(default)]
    pub undeclared_sigma_eta: Option<f64>,
    /// Relative standard error of the heat-transfer coefficient; `None` if it was not forecast.
    pub sigma_h_rel: Option<f64>,
    /// Error of the identification method itself in the efficiency, without noise (fraction, signed): its
    /// result minus the model's own mean over the window. `None` if it was not forecast.
    #[serde(default)]
    pub bias_eta: Option<f64>,
    /// Error of the identification method itself in the heat-transfer coefficient, relative. `None` if it was not forecast.
    #[serde(default)]
    pub bias_h_rel: Option<f64>,
    /// Compressor mass flow at the end of the step, kg/s.
    pub flow_kg_s: f64,
    /// Pressure ratio P2/P1 at the end of the step.
    pub pressure_ratio: f64,
    /// Gas temperature at the compressor outlet at the end of the step, K.
    pub t2_k: f64,
    /// Time until the operating point has settled, s; `None` if it does not settle within the dwell.
    pub settle_s: Option<f64>,
    /// Duration of the step, minutes.
    pub minutes: f64,
}

impl Predicted {
    /// A step of which only the settled state is known: flow in kg/s, T2 in K, dwell in s.
    pub fn settled(flow_kg_s: f64, pressure_ratio: f64, t2_k: f64, dwell_s: f64) -> Self {
        Predicted {
            dt2_k: None,
            dtc_k: None,
            sigma_eta: None,
            reported_sigma_eta: None,
            undeclared_sigma_eta: None,
            sigma_h_rel: None,
            bias_eta: None,
            bias_h_rel: None,
            flow_kg_s,
            pressure_ratio,
            t2_k,
            settle_s: None,
            minutes: dwell_s / S_PER_MIN,
        }
    }
}

/// A step: a jump to a point and a dwell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanStep {
    /// Index in the plan, from 0; files have its number, from 1.
    #[serde(flatten, with = "crate::test_plan::step_number::entry")]
    pub index: usize,
    /// Purpose of the step.
    pub kind: StepKind,
    /// Point before the jump; `None` for the first step.
    pub from: Option<OperatingPoint>,
    /// Target speed and valve opening.
    #[serde(flatten)]
    pub to: OperatingPoint,
    /// Turbine inlet total pressure (station 3) that holds the target in steady state, Pa.
    pub p3_pa: f64,
    /// Turbine inlet total temperature (station 3), K.
    pub t3_k: f64,
    /// Oil inlet temperature, K.
    pub oil_temperature_k: f64,
    /// Time at the point, jump included, s.
    pub dwell_s: f64,
    /// Start of the step after the start of the run, s (warm-up included).
    pub start_s: f64,
    /// Ramps from the point before, and their forecast; `None` for the first step, and for small steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transition: Option<Transition>,
    /// Results expected from the nominal model.
    pub predicted: Predicted,
}

/// Hashes of the plan's inputs; a plan with other hashes is stale.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanInputHashes {
    /// SHA-256 of the campaign as parsed (defaults filled in, units resolved).
    pub campaign_sha256: String,
    /// SHA-256 of the nominal model's parameters and map.
    pub model_sha256: String,
    /// SHA-256 of the sequence script, if there was one.
    pub script_sha256: Option<String>,
    /// SHA-256 of the rig's description, if a rig was queried: a plan alone needs none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig_sha256: Option<String>,
}

/// Summary of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PlanFigures {
    /// Sum over the jumps of the housing's temperature change within the window, K (absolute values).
    pub sum_gradient_k: f64,
    /// Smallest of these changes, K; `None` for a plan without jumps.
    pub min_gradient_k: Option<f64>,
    /// Largest predicted standard error of the efficiency (fraction); `None` if it was not forecast.
    pub worst_sigma_eta: Option<f64>,
    /// Root of the mean square of predicted standard error and bias of the efficiency (fraction).
    #[serde(default)]
    pub rms_error_eta: Option<f64>,
    /// Root mean square of the standard errors that the identification will report (fraction): they include other values of alpha_A, probe
    /// and heating/cooling ratio than the declared ones. `None` if the method identifies none of them, or nothing was forecast.
    #[serde(default)]
    pub rms_error_reported_eta: Option<f64>,
    /// Error of the efficiencies that only the declared values of these parameters exclude (fraction).
    #[serde(default, alias = "resting_eta")]
    pub prior_sensitivity_eta: Option<f64>,
    /// Largest predicted error of the efficiency, standard error and bias in quadrature (fraction).
    #[serde(default)]
    pub worst_error_eta: Option<f64>,
    /// Duration of the run, warm-up, cool-down and the search for surge included, minutes.
    pub minutes: f64,
}

/// An ordered, checked list of steps with their expected results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Name of the campaign.
    pub campaign: String,
    /// The criterion of the order, e.g. `thermal_gradient`.
    pub objective: String,
    /// Seed of the search (and of simulated rigs).
    pub seed: u64,
    /// The inputs of the plan.
    pub made_from: PlanInputHashes,
    /// Time at the first point before the first step starts, s.
    pub warm_up_s: f64,
    /// Time at standstill conditions after the last step, s.
    pub cool_down_s: f64,
    /// The steps in order.
    pub steps: Vec<PlanStep>,
    /// Forecast time of the search for surge after the steps, s; 0 without a search.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub surge_search_s: f64,
    /// Summary of the plan.
    pub figures: PlanFigures,
    /// Remarks for the operator of the plan.
    #[serde(
        default,
        serialize_with = "crate::json_messages::serialize",
        deserialize_with = "deserialize_remarks"
    )]
    pub remarks: Vec<PlanRemark>,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Plan {
    /// The remark about the slowest crossing of speeds to avoid; `None` if no jump crosses any.
    pub fn avoided_crossing(&self) -> Option<PlanRemark> {
        let crossings = self.steps.iter().filter_map(|step| Some((step.index, step.transition?.avoided?)));
        let (index, crossing) = crossings.max_by(|a, b| a.1.ratio().total_cmp(&b.1.ratio()))?;
        let AvoidedCrossing { range: AvoidedRange { from_rpm, to_rpm, longest_s }, inside_s } = crossing;
        let step = step_number(index);
        Some(PlanRemark::AvoidedCrossing { step, from_rpm, to_rpm, inside_s, longest_s })
    }

    /// Duration of the whole run, warm-up, cool-down and the search for surge included, s.
    pub fn duration_s(&self) -> f64 {
        let steps_s = self.steps.iter().map(|step| step.dwell_s).sum::<f64>();
        self.warm_up_s + steps_s + self.surge_search_s + self.cool_down_s
    }
}

/// A ramp of a command, from its value before the step to that of the step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Start after the start of the step, s, >= 0.
    pub start_s: f64,
    /// Duration, s, >= 0.
    pub duration_s: f64,
}

impl Ramp {
    /// End after the start of the step, s.
    pub fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    /// Completed share at `t_s` after the start of the step, 0 to 1.
    pub fn share(&self, t_s: f64) -> f64 {
        if t_s >= self.end_s() {
            1.0
        } else if t_s <= self.start_s {
            0.0
        } else {
            (t_s - self.start_s) / self.duration_s
        }
    }
}

/// Coordinated ramps of P3 and valve. When P3 falls, the valve moves no faster than P3; when it rises, P3 rises no faster than the valve moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramps {
    /// Turbine inlet pressure.
    pub p3: Ramp,
    /// Back-pressure valve.
    pub valve: Ramp,
}

impl Ramps {
    /// Overlapping ramps over these changes, at the rates of the actuators; `shaft_s`: time constant of the shaft. The follower stays behind
    /// the leader's lag.
    pub fn overlapping(
        p3_change_pa: f64,
        opening_change_ratio: f64,
        shaft_s: f64,
        actuators: &RigActuators,
    ) -> Self {
        let RigActuators { p3, valve, .. } = actuators;
        let duration_s = p3.ramp_s(p3_change_pa).max(valve.ramp_s(opening_change_ratio));
        let (p3_delay_s, valve_delay_s) = (p3.dead_time_s + p3.lag_s, valve.dead_time_s + valve.lag_s);
        let ramp = |start_s: f64| Ramp { start_s: start_s.max(0.0), duration_s };
        if p3_change_pa < 0.0 {
            Ramps { p3: ramp(0.0), valve: ramp(p3_delay_s + shaft_s - valve_delay_s) }
        } else {
            Ramps { p3: ramp(valve_delay_s - p3_delay_s), valve: ramp(0.0) }
        }
    }

    /// Share of its change by which the valve may be ahead of a falling P3. Bound: the rest of a lag takes longer than all before, and is
    /// within the error of its reading.
    pub const AHEAD_SHARE: f64 = 0.03;
    /// Fall of P3, relative, above which the valve waits for it. Bound: a smaller one is not clearly above the noise of its reading.
    const MIN_FALL_RATIO: f64 = 0.01;

    /// Whether the valve moves no further than P3 has fallen.
    pub fn valve_waits(from_pa: f64, to_pa: f64) -> bool {
        to_pa < from_pa * (1.0 - Self::MIN_FALL_RATIO)
    }

    /// End of the last ramp after the start of the step, s.
    pub fn end_s(&self) -> f64 {
        self.p3.end_s().max(self.valve.end_s())
    }
}

/// A transition between two points with its forecast on the declared stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transition {
    /// The ramps.
    pub ramps: Ramps,
    /// Time after the start of the step until P3 and valve have arrived, s: 1 % of their change remains.
    pub arrival_s: f64,
    /// Highest shaft speed of the step, rpm.
    pub highest_speed_rpm: f64,
    /// Lowest surge margin of the step: flow over the surge flow at equal corrected speed, minus one.
    pub lowest_surge_margin_ratio: f64,
    /// Highest outlet temperature of the step, K.
    pub highest_t2_k: f64,
    /// The slowest crossing of speeds to avoid; `None` if the shaft is never inside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub avoided: Option<AvoidedCrossing>,
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_runs_from_its_start_to_its_end() {
        let ramp = Ramp { start_s: 2.0, duration_s: 4.0 };
        assert_eq!([0.0, 2.0, 3.0, 6.0, 9.0].map(|t_s| ramp.share(t_s)), [0.0, 0.0, 0.25, 1.0, 1.0]);
        let step = Ramp { start_s: 0.0, duration_s: 0.0 };
        assert_eq!([0.0, 1.0].map(|t_s| step.share(t_s)), [1.0, 1.0]);
    }
}
