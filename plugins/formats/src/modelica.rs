//! Modelica: three tables for `Modelica.Blocks.Tables.CombiTable2Ds` (u1 corrected speed in rpm, u2 beta), as ThermoPower
//! reads its compressor maps.
//!
//! Modelica Standard Library 4.0, `Modelica.Blocks.Tables`: text files begin with `#1`; a table is
//! `double name(rows, columns)`. Its first row has one unused number and the values of u2, its first column the values of u1.

use crate::simulation_table::{SimulationTable, heading, joined};
use mapper_core::{CompressorMap, ExportError, MapFormat};
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "modelica",
    extension: "modelica.txt",
    description: "tables over corrected speed and beta for Modelica.Blocks.Tables.CombiTable2Ds",
    write: Some(write),
    read: Some(mapper_maps::table::read_any_bytes),
    turbine: crate::turbine::MODELICA,
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let table = SimulationTable::of(map, FORMAT.name)?;
    // The version must be the very first line.
    let mut text = format!("#1\n{}{}", heading(map, "#"), table.remarks("#"));
    text.push_str("# u1: corrected speed, rpm; u2: beta, 0 at choke, 1 at surge\n");
    for (name, what, values) in [
        ("flow_corrected_kg_s", "corrected flow, kg/s", &table.flow_kg_s),
        ("pressure_ratio", "total pressure ratio", &table.pressure_ratio),
        ("eta", "isentropic efficiency", &table.eta),
    ] {
        let (rows, columns) = (table.speeds_rpm.len() + 1, table.beta.len() + 1);
        let _ = writeln!(text, "double {name}({rows},{columns}) # {what}");
        let _ = writeln!(text, "0 {}", joined(&table.beta, " "));
        for (speed, row) in table.speeds_rpm.iter().zip(values) {
            let _ = writeln!(text, "{speed} {}", joined(row, " "));
        }
    }
    Ok(text.into_bytes())
}
