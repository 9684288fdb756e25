//! The identification methods in the form that the planner needs.

use mapper_identify::{IdentifyConfig, PressureTap, expected, expected_steady, expected_together};
use mapper_planner::{ForecastRow, MethodResult, MethodResults, PredictedMethod};

/// Which steps a method identifies together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Each step separately (`dynamic`).
    EachStep,
    /// All steps together (`joint`).
    AllSteps,
    /// Settled points only (`steady`).
    Settled,
}

/// The campaign's method, after its zero.
#[derive(Debug)]
pub(crate) struct Forecaster {
    config: IdentifyConfig,
    scope: Scope,
}

impl Forecaster {
    /// The method under `config`.
    pub(crate) fn of(config: IdentifyConfig, scope: Scope) -> Self {
        // A forecast uses total pressures.
        let total = PressureTap::Total;
        Forecaster { config: IdentifyConfig { inlet_tap: total, outlet_tap: total, ..config }, scope }
    }
}

impl PredictedMethod for Forecaster {
    fn predict_step(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult> {
        if self.scope != Scope::EachStep || window.is_empty() {
            return None;
        }
        expected(window, interval_s, &self.config)
    }

    fn predict_campaign(&self, steps: &[&[ForecastRow]]) -> Option<MethodResults> {
        if self.scope != Scope::AllSteps {
            return None;
        }
        expected_together(steps, &self.config)
    }

    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)> {
        expected_steady(row, &self.config)
    }
}
