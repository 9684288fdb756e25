//! The answer, as it is printed and written as JSON.

use crate::cause::Cause;
use crate::time_history::{Course, CourseKind};
use serde::Serialize;
use std::collections::BTreeMap;

/// The answer in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriftVerdict {
    /// It is more probable that nothing drifted than that anything did.
    None,
    /// One or more sensors drift.
    Sensor,
    /// The machine changes.
    Machine,
    /// The machine changes and a sensor drifts.
    SensorAndMachine,
    /// Something may have moved, but the recording cannot tell what; or it cannot tell whether: `reason` says.
    Unclear,
}

/// How fast, or how far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RateOrStep {
    /// Change per hour.
    RatePerH(f64),
    /// Change at the onset.
    Step(f64),
}

/// A cause with its probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Alternative {
    /// The cause; `None` is not drift.
    pub cause: Option<Cause>,
    /// Its probability; all of them and that of `none` sum to 1.
    pub probability: f64,
}

/// The smallest drift that is seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DetectionLimit {
    /// The cause.
    pub cause: Cause,
    /// Steady drift over the whole campaign that is expected to be as probable as none, unit of the cause.
    pub change: f64,
    /// Unit.
    pub unit: &'static str,
}

/// A channel at one visit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VisitChannel {
    /// Mean reading over the end of the step, SI.
    pub end: f64,
    /// The same minus the model's, SI: boundary conditions that wander are taken out.
    pub end_less_model: f64,
    /// Mean reading over the transient minus the model's, SI; `None` where the step is too short.
    pub transient_less_model: Option<f64>,
    /// One standard error of the end, from noise, SI.
    pub sigma: f64,
}

/// One visit of a repeated jump.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Visit {
    /// Which recording, from 0.
    pub run: usize,
    /// Place of the step in the recording, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::step_number::serialize")]
    pub step: usize,
    /// Start of the step, time of the campaign, s.
    pub t_s: f64,
    /// Identified efficiency, fraction.
    pub eta: Option<f64>,
    /// One standard error of it from noise, fraction: offsets are the same at each visit.
    pub sigma_eta: Option<f64>,
    /// Change of it since the first visit, fraction.
    pub change_eta: Option<f64>,
    /// Identified heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: Option<f64>,
    /// One standard error of it from noise, W/(m2 K).
    pub sigma_h_w_m2k: Option<f64>,
    /// Change of it since the first visit, W/(m2 K).
    pub change_h_w_m2k: Option<f64>,
    /// Channels by symbol.
    pub channels: BTreeMap<&'static str, VisitChannel>,
}

/// All visits of one jump.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatGroup {
    /// Where the jump starts, in words.
    pub from: String,
    /// Where it leads, in words.
    pub to: String,
    /// Its visits, in order of time.
    pub visits: Vec<Visit>,
}

/// A point of the map without the drift.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrectedPoint {
    /// Which recording, from 0.
    pub run: usize,
    /// Place of the step in the recording, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::step_number::serialize")]
    pub step: usize,
    /// Measured shaft speed at the end of the step, rpm.
    pub speed_rpm: f64,
    /// Commanded valve opening relative to the nominal area.
    pub valve: f64,
    /// Efficiency of the model as fitted to all steps of the campaign, the drift taken out, fraction.
    pub eta: f64,
    /// One standard error of `eta`, fraction.
    pub sigma_eta: f64,
    /// Heat-transfer coefficient of the model as fitted, W/(m2 K).
    pub h_w_m2k: f64,
    /// Efficiency identified from this step with the drift taken out of the readings, fraction.
    pub eta_identified: Option<f64>,
    /// Efficiency identified from this step as recorded, fraction.
    pub eta_uncorrected: Option<f64>,
    /// What was subtracted at the end of this step, for each drift in their order, unit of its cause.
    pub corrections: Vec<f64>,
}

/// Something that drifts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundDrift {
    /// What drifts.
    pub cause: Cause,
    /// Probability that it is this, beside the other drifts; the rest is that of `alternatives`.
    pub probability: f64,
    /// What may stand in its place, none included, most probable first.
    pub alternatives: Vec<Alternative>,
    /// Onset, time of the campaign, s.
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
    pub unit: &'static str,
}

impl FoundDrift {
    /// Whether it is more probable than all that may stand in its place.
    pub fn is_clear(&self) -> bool {
        self.probability >= 0.5
    }

    /// Its size at a time of the campaign, s; unit of the cause.
    pub fn at(&self, t_s: f64) -> f64 {
        let (kind, size) = match self.size {
            RateOrStep::RatePerH(rate) => (CourseKind::Ramp, rate),
            RateOrStep::Step(step) => (CourseKind::Step, step),
        };
        size * Course { kind, onset_s: self.onset_s }.at(t_s)
    }
}

/// What is said of a campaign.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriftReport {
    /// In a word.
    pub verdict: DriftVerdict,
    /// What drifts, the most probable set; empty where nothing does or it is not known.
    pub drifts: Vec<FoundDrift>,
    /// No drift, and each cause as the only one, most probable first; sums to 1. Empty where there is no verdict.
    pub alone: Vec<Alternative>,
    /// In sentences: why there is no verdict, what was found, what was corrected.
    pub reason: String,
    /// Smallest drift that is seen, per cause.
    pub detection_limits: Vec<DetectionLimit>,
    /// Repeated jumps.
    pub groups: Vec<RepeatGroup>,
    /// Points of the map without the drifts; empty where nothing drifts.
    pub corrected_points: Vec<CorrectedPoint>,
}

impl DriftReport {
    /// A recording that cannot tell, with why.
    pub fn without_verdict(reason: String) -> Self {
        DriftReport {
            verdict: DriftVerdict::Unclear,
            drifts: Vec::new(),
            alone: Vec::new(),
            reason,
            detection_limits: Vec::new(),
            groups: Vec::new(),
            corrected_points: Vec::new(),
        }
    }
}
