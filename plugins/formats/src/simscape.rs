//! Simscape: a MATLAB script with M x N tables over corrected speed and beta (Compressor (G)), and, for Powertrain
//! Blockset, flow and efficiency over corrected speed and pressure ratio.

use crate::simulation_table::{SimulationTable, heading, joined};
use mapper_core::{CompressorMap, ExportError, MapFormat};
use std::fmt::Write;

/// Pressure ratios of the second pair of tables.
const RATIOS: usize = 25;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "simscape",
    extension: "m",
    description: "MATLAB script: tables over corrected speed and beta, and over corrected speed and pressure ratio",
    write: Some(write),
    read: Some(mapper_maps::table::read_any_bytes),
    turbine: crate::turbine::SIMSCAPE,
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let table = SimulationTable::of(map, FORMAT.name)?;
    let mut text = format!("{}{}", heading(map, "%"), table.remarks("%"));
    let _ = writeln!(
        text,
        "reference_temperature_K = {};\nreference_pressure_Pa = {};",
        map.reference.t_ref_k, map.reference.p_ref_pa
    );
    text.push_str("% over corrected speed (rows) and beta (columns, 0 at choke, 1 at surge)\n");
    let _ = writeln!(text, "corrected_speed_rpm = [{}];", joined(&table.speeds_rpm, " "));
    let _ = writeln!(text, "beta = [{}];", joined(&table.beta, " "));
    matrix(&mut text, "pressure_ratio", &table.pressure_ratio);
    matrix(&mut text, "corrected_flow_kg_s", &table.flow_kg_s);
    matrix(&mut text, "isentropic_efficiency", &table.eta);
    text.push_str(
        "% over corrected speed (rows) and pressure ratio (columns); beyond either end of a line its last value is held\n",
    );
    let highest = table.pressure_ratio.iter().flatten().copied().fold(1.0, f64::max);
    let ratios: Vec<f64> =
        (0..RATIOS).map(|i| 1.0 + (highest - 1.0) * i as f64 / (RATIOS - 1) as f64).collect();
    let _ = writeln!(text, "pressure_ratio_axis = [{}];", joined(&ratios, " "));
    for (name, values) in [("corrected_flow_of_pr_kg_s", &table.flow_kg_s), ("efficiency_of_pr", &table.eta)]
    {
        let rows: Vec<Vec<f64>> = table
            .pressure_ratio
            .iter()
            .zip(values)
            .map(|(line, values)| ratios.iter().map(|ratio| value_at_ratio(line, values, *ratio)).collect())
            .collect();
        matrix(&mut text, name, &rows);
    }
    Ok(text.into_bytes())
}

fn matrix(text: &mut String, name: &str, rows: &[Vec<f64>]) {
    let _ = writeln!(text, "{name} = [");
    for row in rows {
        let _ = writeln!(text, "  {}", joined(row, " "));
    }
    text.push_str("];\n");
}

/// A value at a pressure ratio, on the falling side of the line; constant beyond both ends.
fn value_at_ratio(ratios: &[f64], values: &[f64], wanted: f64) -> f64 {
    let mut last = values[0];
    for i in 1..ratios.len() {
        if ratios[i] <= ratios[i - 1] {
            // Beyond the maximum pressure ratio, flow is not a function of it.
            break;
        }
        if wanted <= ratios[i] {
            let share = ((wanted - ratios[i - 1]) / (ratios[i] - ratios[i - 1])).clamp(0.0, 1.0);
            return values[i - 1] + share * (values[i] - values[i - 1]);
        }
        last = values[i];
    }
    last
}
