//! The steps that a script requests, and the messages of its thread.

use crate::error::ScriptError;
use crate::settle::SettleRule;
use mapper_core::PlanStep;

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
