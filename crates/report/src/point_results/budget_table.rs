//! The uncertainty budgets of the points, as tables for the report and as a file.

use crate::document::{Document, Table};
use mapper_core::{PointBudgets, UncertaintyBudget, step_number};

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

/// Contributions to the efficiency of every point, and to its pressure ratio; empty without budgets.
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
