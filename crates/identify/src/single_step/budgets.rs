//! Uncertainty budgets of a point.

use crate::IdentifyConfig;
use crate::single_step::dynamic::Estimate;
use mapper_core::{
    BudgetRow, Channel, EstimateUncertainty, IdentifiedPoint, PointBudgets, UncertaintyBudget, half_width_95,
};

/// A source with its standard uncertainty in its unit.
pub(crate) fn row(source: String, sigma: f64, unit: &str, sensitivity: f64, contribution: f64) -> BudgetRow {
    BudgetRow {
        source,
        standard_uncertainty: sigma,
        unit: unit.to_owned(),
        sensitivity,
        contribution,
        degrees_of_freedom: None,
    }
}

/// A source that is known in the unit of the number only.
pub(crate) fn own_row(source: &str, contribution: f64, unit: &str) -> BudgetRow {
    row(source.to_owned(), contribution.abs(), unit, 1.0_f64.copysign(contribution), contribution)
}

/// The budgets of a point from its estimate, and that of what may be something else. `samples`: number of samples that its state is the mean of.
pub(crate) fn of_point(
    point: &IdentifiedPoint,
    eta_allowance: Option<UncertaintyBudget>,
    estimate: &Estimate,
    samples: impl Fn(Channel) -> usize,
    config: &IdentifyConfig,
) -> PointBudgets {
    let of =
        |value: Option<f64>, low: Option<f64>, high: Option<f64>, rows: &[BudgetRow], error, unit: &str| {
            let rows = if rows.is_empty() { by_origin(error?, unit) } else { rows.to_vec() };
            Some(UncertaintyBudget::of(value?, rows, 0.5 * (high? - low?)))
        };
    let [eta, h] = &estimate.budgets;
    PointBudgets {
        step: point.step,
        eta: of(point.eta, point.eta_low, point.eta_high, eta, point.eta_uncertainty, "1"),
        eta_allowance,
        h_w_m2k: of(point.h_w_m2k, point.h_low_w_m2k, point.h_high_w_m2k, h, point.h_uncertainty, "W/(m2 K)"),
        pressure_ratio: pressure_ratio(point, samples, config),
    }
}

/// The two origins that every method gives.
fn by_origin(error: EstimateUncertainty, unit: &str) -> Vec<BudgetRow> {
    vec![
        own_row("noise", error.noise_standard_error, unit),
        own_row("declared errors of the sensors, assumptions", error.bias_standard_error, unit),
    ]
}

fn pressure_ratio(
    point: &IdentifiedPoint,
    samples: impl Fn(Channel) -> usize,
    config: &IdentifyConfig,
) -> UncertaintyBudget {
    let (ratio, p1_pa) = (point.pressure_ratio, point.p1_pa);
    let p2_pa = ratio * p1_pa;
    let mut rows = Vec::new();
    let mut push = |source: String, sigma: f64, unit: &str, sensitivity: f64| {
        if sigma > 0.0 {
            rows.push(row(source, sigma, unit, sensitivity, sensitivity * sigma));
        }
    };
    for (channel, reading_pa, by_reading) in
        [(Channel::P1, p1_pa, -ratio / p1_pa), (Channel::P2, p2_pa, ratio / p2_pa)]
    {
        let declared = config.sensor(channel);
        push(format!("offset of {channel}"), declared.offset_sigma, "Pa", by_reading);
        push(
            format!("gain of {channel}"),
            declared.gain_sigma_ratio,
            "1",
            by_reading * config.exact_at.gain_error(channel, reading_pa),
        );
        let mean = config.noise().variance_of_mean(samples(channel), config.thresholds.end_mean_s).sqrt();
        push(format!("noise of {channel}"), declared.noise_sigma * mean, "Pa", by_reading);
    }
    push("barometer".to_owned(), config.barometer_sigma_pa, "Pa", (1.0 - ratio) / p1_pa);
    let mut budget = UncertaintyBudget::of(ratio, rows, 0.0);
    let half = half_width_95(budget.combined_standard_uncertainty());
    budget.expanded_uncertainty = half;
    budget.coverage_factor = half_width_95(1.0);
    budget
}
