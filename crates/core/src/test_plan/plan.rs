//! The plan as data: steps, their order, and the expected results.

use crate::test_plan::plan_remark::{PlanRemark, deserialize_remarks};
use crate::test_plan::transition::Transition;
use crate::unit_factors::S_PER_MIN;
use crate::{AvoidedCrossing, AvoidedRange, OperatingPoint, step_number};
use serde::{Deserialize, Serialize};

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
