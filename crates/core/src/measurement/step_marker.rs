//! Position of a step in a recording.

use crate::{OperatingPoint, StepKind, step_number};
use serde::{Deserialize, Serialize};

/// Start and end of one executed step (or of one found in an imported recording).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StepMarker {
    /// Index of the step in its plan, or in order of appearance, from 0; files have its number, from 1.
    #[serde(flatten, with = "crate::test_plan::step_number::entry")]
    pub index: usize,
    /// Point or repeat.
    pub kind: StepKind,
    /// Run time of the change of setpoints, s.
    pub start_s: f64,
    /// Run time of the step's end, s.
    pub end_s: f64,
    /// The point before the jump; `None` for the first step, and in imported recordings.
    pub from: Option<OperatingPoint>,
    /// The target of the plan; `None` in imported recordings.
    pub to: Option<OperatingPoint>,
    /// Commanded turbine inlet total pressure, Pa.
    pub p3_pa: f64,
    /// Commanded valve opening relative to the nominal area.
    #[serde(rename = "valve")]
    pub valve_opening_ratio: f64,
}

impl StepMarker {
    /// First index of steps that a resumed run repeats outside its plan: no plan has that many steps.
    pub const FIRST_REPEAT_INDEX: usize = 1_000_000;

    /// Number of the step in its run, from 1; `None` for a repeated step outside the plan.
    pub fn number(&self) -> Option<usize> {
        (self.index < StepMarker::FIRST_REPEAT_INDEX).then(|| step_number(self.index))
    }
}
