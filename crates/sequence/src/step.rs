//! What a script hands over at each step.

use crate::error::ScriptError;
use crate::settle::SettleRule;
use mapper_core::PlanStep;

/// How long a step lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hold {
    /// As long as the step says.
    Dwell,
    /// Until it has settled, at most as long as the step says.
    UntilSettled(SettleRule),
}

/// A step that a script wants to be run, checked against the campaign's limits.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceStep {
    /// The step; its `dwell_s` is the longest time it may take.
    pub step: PlanStep,
    /// When it may end earlier.
    pub hold: Hold,
}

/// What comes from the script's thread, with the notes since the last time.
#[derive(Debug)]
pub(crate) enum FromScript {
    Step(Box<SequenceStep>, Vec<String>),
    Done(Vec<String>),
    Failed(Box<ScriptError>, Vec<String>),
}
