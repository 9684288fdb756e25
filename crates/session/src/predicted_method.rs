//! The dynamic method as the planner sees it.

use mapper_identify::{ExpectedRow, IdentifyConfig, PressureTap, expected, expected_steady};
use mapper_planner::{ForecastRow, MethodResult, PredictedMethod};

/// The dynamic method with the campaign's settings.
#[derive(Debug)]
pub struct Dynamic {
    config: IdentifyConfig,
}

impl Dynamic {
    /// The method under `config`.
    pub fn of(config: IdentifyConfig) -> Self {
        // A forecast's pressures are total ones.
        let total = PressureTap::Total;
        Dynamic { config: IdentifyConfig { inlet_tap: total, outlet_tap: total, ..config } }
    }
}

impl PredictedMethod for Dynamic {
    fn predict(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult> {
        let rows: Vec<ExpectedRow> = window.iter().map(expected_row).collect();
        let found = expected(&rows, interval_s, &self.config)?;
        Some(MethodResult {
            eta: found.eta,
            sigma_eta: found.sigma_eta,
            h_w_m2k: found.h_w_m2k,
            sigma_h_w_m2k: found.sigma_h_w_m2k,
        })
    }

    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)> {
        expected_steady(&expected_row(row), &self.config)
    }
}

fn expected_row(row: &ForecastRow) -> ExpectedRow {
    ExpectedRow {
        t_s: row.t_s,
        t1_k: row.t1_k,
        t2_k: row.t2_k,
        tc_k: row.tc_k,
        p1_pa: row.p1_pa,
        p2_pa: row.p2_pa,
        flow_kg_s: row.flow_kg_s,
    }
}
