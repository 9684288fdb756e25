//! The report, printed and written as JSON.

use crate::drift::causes::{Cause, RATE_PER_H};
use mapper_inference::hypotheses::{Shape, TimeHistory};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriftVerdict {
    /// No drift is more probable than any drift.
    None,
    /// One or more sensors drift.
    Sensor,
    /// The machine changes.
    Machine,
    /// The machine changes and a sensor drifts.
    SensorAndMachine,
    /// The recording cannot identify the drift, or cannot show whether there is one: see `reason`.
    #[default]
    Unclear,
}

/// Rate or step size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RateOrStep {
    /// Change per hour.
    RatePerH(f64),
    /// Change at the onset.
    Step(f64),
}

/// A cause with its probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// The cause; `None` means no drift.
    pub cause: Option<Cause>,
    /// Its probability; all of them and that of `none` sum to 1.
    pub probability: f64,
}

/// The smallest detectable drift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DetectionLimit {
    pub cause: Cause,
    /// Expected steady drift over the whole campaign that is as probable as none, unit of the cause.
    pub change: f64,
    pub unit: &'static str,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VisitChannel {
    /// Mean reading over the end of the step, SI.
    pub end: f64,
    /// The same minus the model's, SI: without the effect of changing boundary conditions.
    pub end_less_model: f64,
    /// Mean reading over the transient minus the model's, SI; `None` if the step is too short.
    pub transient_less_model: Option<f64>,
    /// One standard error of the mean at the end, from noise, SI.
    pub sigma: f64,
}

/// One visit of a repeated jump.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Visit {
    /// Which recording, from 0.
    pub run: usize,
    /// Position of the step in the recording, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub step: usize,
    /// Start of the step, campaign time, s.
    pub t_s: f64,
    /// Identified efficiency, fraction.
    pub eta: Option<f64>,
    /// One standard error of it from noise, fraction: offsets are equal at each visit.
    pub sigma_eta: Option<f64>,
    /// Its change since the first visit, fraction.
    pub change_eta: Option<f64>,
    /// Identified heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: Option<f64>,
    /// One standard error of it from noise, W/(m2 K).
    pub sigma_h_w_m2k: Option<f64>,
    /// Its change since the first visit, W/(m2 K).
    pub change_h_w_m2k: Option<f64>,
    /// Channels by symbol.
    pub channels: BTreeMap<&'static str, VisitChannel>,
}

/// All visits of one jump.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatGroup {
    /// Description of the jump's start.
    pub from: String,
    /// Description of the jump's end.
    pub to: String,
    /// Its visits, in order of time.
    pub visits: Vec<Visit>,
}

/// A map point corrected for the drift.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrectedPoint {
    /// Which recording, from 0.
    pub run: usize,
    /// Position of the step in the recording, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub step: usize,
    /// Measured shaft speed at the end of the step, rpm.
    pub speed_rpm: f64,
    /// Commanded valve opening relative to the nominal area.
    pub valve: f64,
    /// Efficiency of the model fitted to all steps of the campaign, with the drift subtracted, fraction.
    pub eta: f64,
    /// One standard error of `eta`, fraction.
    pub sigma_eta: f64,
    /// Heat-transfer coefficient of the fitted model, W/(m2 K).
    pub h_w_m2k: f64,
    /// Efficiency identified from this step with the drift subtracted from the readings, fraction.
    pub eta_identified: Option<f64>,
    /// Efficiency identified from this step as recorded, fraction.
    pub eta_uncorrected: Option<f64>,
    /// Drift subtracted at the end of this step, for each drift in order, unit of its cause.
    pub corrections: Vec<f64>,
}

/// A detected drift.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundDrift {
    /// The cause.
    pub cause: Cause,
    /// Probability of this cause, given the other drifts; `alternatives` have the remainder.
    pub probability: f64,
    /// Alternative causes, including none, most probable first.
    pub alternatives: Vec<Alternative>,
    /// Onset, campaign time, s.
    pub onset_s: f64,
    /// Lower end of its 95 % interval, s.
    pub onset_low_s: f64,
    /// Upper end of its 95 % interval, s.
    pub onset_high_s: f64,
    /// Rate or step.
    #[serde(flatten)]
    pub size: RateOrStep,
    /// Lower end of the 95 % interval of rate or step.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit of the drifting quantity; a rate is per hour.
    pub unit: Cow<'static, str>,
}

impl FoundDrift {
    pub(crate) fn is_clear(&self) -> bool {
        self.probability >= 0.5
    }

    /// Its size at a campaign time, s; unit of the cause.
    pub fn at(&self, t_s: f64) -> f64 {
        let (shape, size) = match self.size {
            RateOrStep::RatePerH(rate) => (RATE_PER_H, rate),
            RateOrStep::Step(step) => (Shape::Step, step),
        };
        size * TimeHistory { onset: self.onset_s, shape }.at(t_s)
    }
}

/// The drift report of a campaign. From a file it has only what is subtracted: verdict, drifts and reason.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct DriftReport {
    /// The verdict.
    pub verdict: DriftVerdict,
    /// Detected drifts, the most probable set; empty if there are none or no verdict is possible.
    pub drifts: Vec<FoundDrift>,
    /// No drift, and each cause as the only one, most probable first; sums to 1. Empty without a verdict.
    pub alone: Vec<Alternative>,
    /// Sentences: why there is no verdict, or the causes and the corrections.
    pub reason: String,
    /// End of the first repeated visit, campaign time, s: a change before it is in all visits and is not seen. `None` without repeats.
    pub unseen_before_s: Option<f64>,
    /// Smallest detectable drift, per cause.
    #[serde(skip_deserializing)]
    pub detection_limits: Vec<DetectionLimit>,
    /// Repeated jumps.
    #[serde(skip_deserializing)]
    pub groups: Vec<RepeatGroup>,
    /// Map points corrected for the drifts; empty if nothing drifts.
    #[serde(skip_deserializing)]
    pub corrected_points: Vec<CorrectedPoint>,
}

impl DriftReport {
    /// The report of a recording without enough information, with the reason.
    pub fn without_verdict(reason: String) -> Self {
        DriftReport { reason, ..DriftReport::default() }
    }
}
