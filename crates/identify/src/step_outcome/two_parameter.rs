//! Result of the two-parameter method for a step that another method has identified.

use serde::Serialize;

/// The efficiency that the two-parameter method (`dynamic`) finds in a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TwoParameter {
    /// Place of the step, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub step: usize,
    /// Isentropic efficiency, total to total, fraction.
    pub eta: f64,
    /// Lower end of its 95 % interval.
    pub eta_low: f64,
    /// Upper end.
    pub eta_high: f64,
}
