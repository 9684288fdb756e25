//! Tables of points for the report: uncertainty budgets, also as a file; coefficients of the wheel, and the flow at the probe of the outlet.

use crate::document::{Document, Table};
use crate::formatting::{Display, number};
use crate::point_results::points::{at_end, step_name};
use mapper_campaign::Campaign;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, IdentifiedPoint, PointBudgets, Recording, UncertaintyBudget, step_number};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::wheel::{MeasuredPoint, WheelCoefficients, pipe_flow};
use mapper_recording::score::ScoredPoint;

/// The budgets as a file: a row for each source of each number. An empty cell of degrees of freedom: the uncertainty is known exactly.
pub fn budget_csv(budgets: &[PointBudgets]) -> std::io::Result<Vec<u8>> {
    let number = |value: f64| format!("{value:e}");
    let freedom = |value: Option<f64>| value.map(|value| format!("{value:.1}")).unwrap_or_default();
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record([
        "step",
        "quantity",
        "value",
        "source",
        "standard_uncertainty",
        "unit",
        "sensitivity",
        "contribution",
        "degrees_of_freedom",
        "combined_standard_uncertainty",
        "effective_degrees_of_freedom",
        "coverage_factor",
        "expanded_uncertainty",
    ])?;
    for point in budgets {
        let numbers = [
            ("eta", point.eta.as_ref()),
            ("eta_allowance", point.eta_allowance.as_ref()),
            ("h_w_m2k", point.h_w_m2k.as_ref()),
            ("pressure_ratio", Some(&point.pressure_ratio)),
        ];
        for (quantity, budget) in numbers {
            let Some(budget) = budget else { continue };
            for row in &budget.rows {
                writer.write_record([
                    step_number(point.step).to_string(),
                    quantity.to_owned(),
                    number(budget.value),
                    row.source.clone(),
                    number(row.standard_uncertainty),
                    row.unit.clone(),
                    number(row.sensitivity),
                    number(row.contribution),
                    freedom(row.degrees_of_freedom),
                    number(budget.combined_standard_uncertainty()),
                    freedom(budget.degrees_of_freedom),
                    format!("{:.2}", budget.coverage_factor),
                    number(budget.expanded_uncertainty),
                ])?;
            }
        }
    }
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}

pub(crate) fn budget_section(budgets: &[PointBudgets]) -> Document {
    let etas: Vec<(usize, &UncertaintyBudget)> =
        budgets.iter().filter_map(|point| Some((point.step, point.eta.as_ref()?))).collect();
    let allowances: Vec<(usize, &UncertaintyBudget)> =
        budgets.iter().filter_map(|point| Some((point.step, point.eta_allowance.as_ref()?))).collect();
    let ratios: Vec<(usize, &UncertaintyBudget)> =
        budgets.iter().map(|point| (point.step, &point.pressure_ratio)).collect();
    let mut document = Document::default();
    if etas.is_empty() {
        return document;
    }
    document.text(
        "Contributions to the standard uncertainty by source, in the form of the GUM: standard uncertainty of the source times sensitivity. \
         They combine as the root of the sum of squares; U is k times that, with a coverage of 95 %. `budget.csv` has standard \
         uncertainties, sensitivities and degrees of freedom, also of h.",
    );
    document.table(budget_table(&etas, 100.0).caption("Efficiency, points"));
    document.text(
        "The efficiency is that of the wheel as the method defines it. What follows would be the same for the method, and is not in its \
         intervals; `tolerances:` has the sizes.",
    );
    document.table(budget_table(&allowances, 100.0).caption("Efficiency that may be something else, points"));
    document.table(budget_table(&ratios, 1e3).caption("Pressure ratio, 1e-3"));
    document
}

fn budget_table(budgets: &[(usize, &UncertaintyBudget)], scale: f64) -> Table {
    let mut sources: Vec<&str> = Vec::new();
    for row in budgets.iter().flat_map(|(_, budget)| &budget.rows) {
        if !sources.contains(&row.source.as_str()) {
            sources.push(&row.source);
        }
    }
    let heads = ["step"].into_iter().chain(sources.iter().copied()).chain(["combined", "k", "U"]);
    let cell = |value: f64| format!("{:.2}", scale * value);
    let rows = budgets.iter().map(|(step, budget)| {
        let share_of = |source: &&str| {
            let row = budget.rows.iter().find(|row| row.source == *source);
            row.map_or_else(|| "-".to_owned(), |row| cell(row.contribution.abs()))
        };
        let mut cells = vec![step_number(*step).to_string()];
        cells.extend(sources.iter().map(share_of));
        cells.push(cell(budget.combined_standard_uncertainty()));
        cells.push(format!("{:.2}", budget.coverage_factor));
        cells.push(cell(budget.expanded_uncertainty));
        cells
    });
    Table::new(heads).rows(rows)
}

/// The coefficients at an identified point.
pub fn wheel_coefficients(point: &IdentifiedPoint, wheel_diameter_m: f64, air: Air) -> WheelCoefficients {
    let &IdentifiedPoint { speed_rpm, flow_kg_s, t1_k, p1_pa, pressure_ratio, eta, .. } = point;
    let measured = MeasuredPoint { speed_rpm, flow_kg_s, t1_k, p1_pa, pressure_ratio, eta };
    WheelCoefficients::new(&measured, wheel_diameter_m, air)
}

pub(crate) fn wheel_section(
    campaign: &Campaign,
    points: &[ScoredPoint],
    recording: &Recording,
    air: Air,
    display: &Display,
) -> Option<Document> {
    let machine = &campaign.machine;
    let compressor = &machine.params.compressor;
    if !machine.wheel_is_declared {
        return None;
    }
    let has_outlet = machine.assumed.iter().all(|size| size.key != "compressor.outlet_diameter");
    let mut heads =
        vec!["step".to_owned(), "u2 m/s".to_owned(), "Mu2".to_owned(), "phi".to_owned(), "lambda".to_owned()];
    if has_outlet {
        heads.extend([display.head("p2 static", Kind::Pressure), "M2".to_owned()]);
    }
    let mut table = Table::new(heads);
    for point in points.iter().map(|scored| &scored.point) {
        let wheel = wheel_coefficients(point, compressor.wheel_diameter_m, air);
        let mut row = vec![
            step_name(point),
            number(Some(wheel.tip_speed_m_s), 0),
            number(Some(wheel.blade_mach_number), 3),
            number(Some(wheel.flow_coefficient), 4),
            number(wheel.work_coefficient, 3),
        ];
        if has_outlet {
            let marker = recording.steps.iter().find(|marker| marker.index == point.step);
            let t2_k = marker.and_then(|marker| at_end(recording, marker, Channel::T2));
            let flow = t2_k.and_then(|t2_k| {
                let p2_pa = point.pressure_ratio * point.p1_pa;
                pipe_flow(p2_pa, point.flow_kg_s, t2_k, compressor.outlet_diameter_m, air)
            });
            row.push(flow.map_or_else(|| "-".to_owned(), |(static_pa, _)| display.pressure(static_pa)));
            row.push(number(flow.map(|(_, mach_number)| mach_number), 3));
        }
        table.row(row);
    }
    let mut document = Document::default();
    document.text(
        "u2: tip speed. Mu2 = u2/a1, phi = m/(rho1 u2 D2^2), lambda = work/u2^2, with total quantities at the inlet (Casey and Robinson, J. \
         Turbomachinery 135 (2013) 021034). p2 static, M2: pressure and Mach number in the outlet pipe, at the T2 probe.",
    );
    document.table(table);
    Some(document)
}
