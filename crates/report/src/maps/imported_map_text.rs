//! How a map file was understood, as text.

use crate::formatting::number::range_text;
use crate::formatting::table;
use mapper_core::{ImportRemark, ImportedColumn, ImportedMap, MapPoint};
use std::fmt::Write;

/// The columns, the speed lines, and a sentence for each assumption.
pub fn imported_map_text(imported: &ImportedMap) -> String {
    let map = &imported.map;
    let mut text = String::new();
    text.push_str(&columns_text(&imported.columns, "rpm, kg/s, Pa, K and as fractions"));
    let heads = ["corrected rpm", "points", "flow kg/s", "pressure ratio", "efficiency %"];
    let mut lines = table::with_heads(&heads);
    for line in &map.lines {
        let range = |value: fn(&MapPoint) -> Option<f64>, factor, digits| {
            range_text(line.points.iter().filter_map(value), factor, digits)
        };
        lines.add_row(vec![
            format!("{:.0}", line.speed_corrected_rpm),
            line.points.len().to_string(),
            range(|point| Some(point.flow_corrected_kg_s), 1.0, 4),
            range(|point| Some(point.pressure_ratio), 1.0, 3),
            range(|point| point.eta, 100.0, 1),
        ]);
    }
    let _ = writeln!(text, "{lines}\n\nCorrected to {}.", map.reference);
    let _ = match map.efficiency {
        Some(definition) => writeln!(text, "Efficiency: {}.", definition.description()),
        None => writeln!(text, "The file does not name the definition of its efficiency."),
    };
    for remark in &imported.remarks {
        let _ = writeln!(text, "{}", import_remark_text(remark));
    }
    text
}

/// The columns of a table with their ranges in `units`; empty if there are none.
pub(crate) fn columns_text(columns: &[ImportedColumn], units: &str) -> String {
    if columns.is_empty() {
        return String::new();
    }
    let mut rows = table::with_heads(&["heading", "quantity", "unit", "from", "to"]);
    for column in columns {
        rows.add_row(vec![
            column.heading.clone(),
            column.quantity.to_owned(),
            if column.unit.is_empty() { "none named".to_owned() } else { column.unit.clone() },
            significant(column.low),
            significant(column.high),
        ]);
    }
    format!("{rows}\n\nFrom and to are in {units}.\n\n")
}

fn significant(value: f64) -> String {
    let digits = if value.abs() >= 100.0 { 0 } else { 4 };
    format!("{value:.digits$}")
}

/// A sentence on what was assumed.
pub fn import_remark_text(remark: &ImportRemark) -> String {
    match remark {
        ImportRemark::NoHeading => {
            "The columns have no headings; taken as rpm, kg/s, pressure ratio and efficiency.".to_owned()
        }
        ImportRemark::FurtherColumns { count } => format!(
            "{count} columns after the efficiency have no headings and were omitted; name them by `--with`, e.g. `--with efficiency=#5`."
        ),
        ImportRemark::UnusedColumns { headings } => format!(
            "Columns that are not used: {}. `--with` selects another column for a quantity, e.g. `--with flow=#5`.",
            headings.iter().map(|heading| format!("`{heading}`")).collect::<Vec<_>>().join(", ")
        ),
        ImportRemark::EfficiencyInPercent => {
            "The efficiencies are taken as percentages, from their size.".to_owned()
        }
        ImportRemark::SpeedOfRowAbove => "Rows without a speed have that of the row above.".to_owned(),
        ImportRemark::FlowUnitAssumed => {
            "The file names no unit of flow; kg/s was taken. If it has lb/s, give `--with flow=lb/s`.".to_owned()
        }
        ImportRemark::SpeedParameterAssumed => {
            "The speeds have no unit; they were taken as rpm/K^0.5, from their size. If they are corrected speeds, give `--with speed=rpm`."
                .to_owned()
        }
        ImportRemark::DesignSpeed { rpm } => {
            format!("The relative speeds of the file were multiplied by {rpm} rpm.")
        }
        ImportRemark::NoEfficiency => "The file has no efficiencies.".to_owned(),
        ImportRemark::ReducedQuantities { reference } => {
            format!("Reduced speed and flow were corrected to {reference}; give `--reference` for another state.")
        }
        ImportRemark::Measured => {
            "The points are as measured; they were corrected. Their efficiency is the apparent one: it includes heat transfer."
                .to_owned()
        }
        ImportRemark::ExtrapolatedNodes { count } => {
            format!("{count} extrapolated nodes of a fitted map were omitted.")
        }
    }
}
