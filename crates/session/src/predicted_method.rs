//! The identification methods as the planner sees them.

use mapper_identify::{
    Expected, ExpectedRow, ExpectedStep, IdentifyConfig, PressureTap, StepWorth, VarianceTangent, expected,
    expected_steady, expected_together,
};
use mapper_planner::{ErrorTangent, ForecastRow, MethodResult, PredictedMethod, WorthOfStep};

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
        Some(result(found))
    }

    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)> {
        expected_steady(&expected_row(row), &self.config)
    }
}

/// The joint method with the campaign's settings, after its zero. Where a step is looked at by itself it is the dynamic one.
#[derive(Debug)]
pub struct Joint {
    alone: Dynamic,
}

impl Joint {
    /// The method under `config`.
    pub fn of(config: IdentifyConfig) -> Self {
        Joint { alone: Dynamic::of(config) }
    }
}

impl PredictedMethod for Joint {
    fn predict(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult> {
        self.alone.predict(window, interval_s)
    }

    fn together(&self, steps: &[&[ForecastRow]], as_declared: bool) -> Option<Vec<Option<MethodResult>>> {
        let rows = expected_rows(steps);
        let found = expected_together(&expected_steps(&rows, steps), &self.alone.config, as_declared)?;
        Some(found.into_iter().map(|found| found.map(result)).collect())
    }

    fn worth_to(&self, steps: &[&[ForecastRow]]) -> Option<Box<dyn WorthOfStep>> {
        let rows = expected_rows(steps);
        let worth = StepWorth::about(&expected_steps(&rows, steps), &self.alone.config)?;
        Some(Box::new(Worth(worth)))
    }

    fn tangent_at(
        &self,
        steps: &[&[ForecastRow]],
        measures: &[bool],
        times: f64,
    ) -> Option<Box<dyn ErrorTangent>> {
        let rows = expected_rows(steps);
        let steps = expected_steps(&rows, steps);
        let tangent = VarianceTangent::at(&steps, measures, times, &self.alone.config)?;
        Some(Box::new(Tangent(tangent)))
    }

    fn is_joint(&self) -> bool {
        true
    }

    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)> {
        self.alone.predict_settled(row)
    }
}

#[derive(Debug)]
struct Worth(StepWorth);

impl WorthOfStep for Worth {
    fn of(&self, rows: &[ForecastRow]) -> Option<f64> {
        let expected = expected_rows(&[rows]);
        let step = expected_steps(&expected, &[rows]);
        self.0.of(step.first()?)
    }
}

#[derive(Debug)]
struct Tangent(VarianceTangent);

impl ErrorTangent for Tangent {
    fn start(&self) -> f64 {
        self.0.start()
    }

    fn of(&self, rows: &[ForecastRow], place: usize) -> Option<f64> {
        let expected = expected_rows(&[rows]);
        let step = expected_steps(&expected, &[rows]);
        self.0.of(step.first()?, place)
    }
}

fn expected_rows(steps: &[&[ForecastRow]]) -> Vec<Vec<ExpectedRow>> {
    steps.iter().map(|rows| rows.iter().map(expected_row).collect()).collect()
}

fn expected_steps<'a>(rows: &'a [Vec<ExpectedRow>], steps: &[&[ForecastRow]]) -> Vec<ExpectedStep<'a>> {
    let one = |(rows, step): (&'a Vec<ExpectedRow>, &&[ForecastRow])| {
        let (eta, h_w_m2k) = step.last().map_or((0.0, 0.0), |end| (end.efficiency, end.h_w_m2k));
        ExpectedStep { rows, eta, h_w_m2k }
    };
    rows.iter().zip(steps).map(one).collect()
}

fn result(found: Expected) -> MethodResult {
    MethodResult {
        eta: found.eta,
        sigma_eta: found.sigma_eta,
        h_w_m2k: found.h_w_m2k,
        sigma_h_w_m2k: found.sigma_h_w_m2k,
        open_sigma_eta: found.open_sigma_eta,
    }
}

pub(crate) fn expected_row(row: &ForecastRow) -> ExpectedRow {
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
