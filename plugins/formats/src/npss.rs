//! NPSS: nested tables over beta and corrected speed.

use crate::simulation_table::{SimulationTable, heading, joined};
use mapper_core::{CompressorMap, ExportError, MapFormat};
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "npss",
    extension: "npss.map",
    description: "NPSS tables of flow, pressure ratio and efficiency over beta and corrected speed",
    write: Some(write),
    read: Some(mapper_maps::table::read_any_bytes),
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let table = SimulationTable::of(map, FORMAT.name)?;
    let mut text = format!("{}{}", heading(map, "//"), table.remarks("//"));
    text.push_str("// beta: 0 at choke, 1 at surge; Nc: corrected speed, rpm; Wc: corrected flow, kg/s\n");
    for (name, field, values) in [
        ("TB_Wc", "Wc", &table.flow_kg_s),
        ("TB_PR", "PR", &table.pressure_ratio),
        ("TB_eff", "eff", &table.eta),
    ] {
        let _ = writeln!(text, "Table {name}(real beta, real Nc) {{");
        for (column, beta) in table.beta.iter().enumerate() {
            let at_beta: Vec<f64> = values.iter().map(|row| row[column]).collect();
            let _ = writeln!(text, "  beta = {beta} {{");
            let _ = writeln!(text, "    Nc = {{ {} }}", joined(&table.speeds_rpm, ", "));
            let _ = writeln!(text, "    {field} = {{ {} }}", joined(&at_beta, ", "));
            text.push_str("  }\n");
        }
        text.push_str(
            "  Nc.interp = \"linear\"; Nc.extrap = \"none\";\n  beta.interp = \"linear\"; beta.extrap = \"none\";\n  extrapIsError = 0;\n  printExtrap = 1;\n}\n",
        );
    }
    Ok(text.into_bytes())
}
