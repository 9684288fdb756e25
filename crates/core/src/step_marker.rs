//! Where a step of the plan lies in a recording.

use crate::{OperatingPoint, StepKind};
use serde::{Deserialize, Serialize};

/// Start and end of one step as it was run (or found in a recording made by others).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StepMarker {
    /// Index of the step in its plan, or in order of appearance.
    pub index: usize,
    /// Point or repeat.
    pub kind: StepKind,
    /// Run time of the change of setpoints, s.
    pub start_s: f64,
    /// Run time of the step's end, s.
    pub end_s: f64,
    /// Where the plan came from; `None` for the first step, and in recordings made by others.
    pub from: Option<OperatingPoint>,
    /// Where the plan aimed; `None` in recordings made by others.
    pub to: Option<OperatingPoint>,
    /// Commanded turbine inlet total pressure, Pa.
    pub p3_pa: f64,
    /// Commanded valve opening relative to the nominal area.
    #[serde(rename = "valve")]
    pub valve_opening_ratio: f64,
}
