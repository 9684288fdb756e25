//! A step that a script asks for, and its result.

use crate::error::ScriptError;
use crate::settle::SettleRule;
use mapper_core::{IdentifiedPoint, OperatingPoint, PlanStep, Verdict};

/// End condition of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EndCondition {
    /// After the step's duration.
    Dwell,
    /// As soon as the point has settled, at the latest after the step's duration.
    UntilSettled(SettleRule),
}

/// A step requested by a script, checked against the campaign's limits.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceStep {
    /// The step; its `dwell_s` is its maximum duration.
    pub step: PlanStep,
    /// Condition for an earlier end.
    pub end: EndCondition,
}

/// A message from the script's thread, with the notes since the last one.
#[derive(Debug)]
pub(crate) enum ScriptMessage {
    Step(Box<SequenceStep>, Vec<String>),
    Done(Vec<String>),
    Failed(Box<ScriptError>, Vec<String>),
}

/// A finished step, as the script receives it.
#[derive(Debug, Clone, PartialEq)]
pub struct StepResult {
    /// Number of the step, from 1, as tables print it.
    pub number: usize,
    /// Target.
    pub target: OperatingPoint,
    /// Origin; `None` for the first step.
    pub from: Option<OperatingPoint>,
    /// Start, run time, s.
    pub start_s: f64,
    /// End, run time, s.
    pub end_s: f64,
    /// The identified point; `None` if its position on the map is not known.
    pub identified: Option<IdentifiedPoint>,
}

impl StepResult {
    fn identified<T>(&self, value: impl FnOnce(&IdentifiedPoint) -> Option<T>) -> Option<T> {
        self.identified.as_ref().and_then(value)
    }

    /// Efficiency, fraction; `None` if no usable value exists.
    pub fn eta(&self) -> Option<f64> {
        self.identified(|point| point.eta).filter(|_| self.verdict() != "unusable")
    }

    /// Standard error of the efficiency, fraction; infinite if unknown.
    pub fn sigma_eta(&self) -> f64 {
        let known = self.eta().and_then(|_| self.identified(|point| point.eta_uncertainty));
        known.map_or(f64::INFINITY, |uncertainty| uncertainty.combined_standard_error())
    }

    /// Heat-transfer coefficient, W/(m2 K).
    pub fn h_w_m2k(&self) -> Option<f64> {
        self.identified(|point| point.h_w_m2k).filter(|_| self.verdict() != "unusable")
    }

    /// Standard error of the heat-transfer coefficient, W/(m2 K); infinite if unknown.
    pub fn sigma_h_w_m2k(&self) -> f64 {
        let known = self.h_w_m2k().and_then(|_| self.identified(|point| point.h_uncertainty));
        known.map_or(f64::INFINITY, |uncertainty| uncertainty.combined_standard_error())
    }

    /// `good`, `doubtful` or `unusable`; also `unusable` without a point.
    pub fn verdict(&self) -> &'static str {
        match self.identified.as_ref().map(|point| point.verdict) {
            Some(Verdict::Good) => "good",
            Some(Verdict::Doubtful) => "doubtful",
            Some(Verdict::Unusable) | None => "unusable",
        }
    }
}
