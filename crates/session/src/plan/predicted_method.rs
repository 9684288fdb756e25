//! The identification methods in the form that the planner needs.

use mapper_identify::{
    Expected, ExpectedRow, ExpectedStep, IdentifyConfig, MAX_RESTING_ETA, PressureTap, expected,
    expected_steady, expected_together,
};
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
        let rows: Vec<ExpectedRow> = window.iter().map(expected_row).collect();
        Some(result(expected(&rows, interval_s, &self.config)?))
    }

    fn predict_campaign(&self, steps: &[&[ForecastRow]]) -> Option<MethodResults> {
        if self.scope != Scope::AllSteps {
            return None;
        }
        let rows: Vec<Vec<ExpectedRow>> =
            steps.iter().map(|rows| rows.iter().map(expected_row).collect()).collect();
        let steps: Vec<ExpectedStep<'_>> = rows
            .iter()
            .zip(steps)
            .map(|(rows, step)| ExpectedStep { rows, eta: step.last().map_or(0.0, |end| end.efficiency) })
            .collect();
        let found = expected_together(&steps, &self.config)?;
        Some(MethodResults {
            steps: found.steps.into_iter().map(|found| found.map(result)).collect(),
            reported_sigma_eta: found.reported_sigma_eta,
            parameter_error_eta: found.resting_eta,
            max_parameter_error_eta: MAX_RESTING_ETA,
        })
    }

    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)> {
        expected_steady(&expected_row(row), &self.config)
    }
}

fn result(found: Expected) -> MethodResult {
    let Expected { eta, sigma_eta, h_w_m2k, sigma_h_w_m2k } = found;
    MethodResult { eta, sigma_eta, h_w_m2k, sigma_h_w_m2k }
}

fn expected_row(row: &ForecastRow) -> ExpectedRow {
    ExpectedRow {
        t_s: row.t_s,
        speed_rpm: row.speed_rpm,
        t1_k: row.t1_k,
        t2_k: row.t2_k,
        tc_k: row.tc_k,
        p1_pa: row.p1_pa,
        p2_pa: row.p2_pa,
        flow_kg_s: row.flow_kg_s,
    }
}
