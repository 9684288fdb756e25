//! GSP and GasTurb: tables of flow, efficiency and pressure ratio over beta and corrected speed
//! ([form of the tables](https://www.gspteam.com/GSPsupport/OnlineHelp/map_table_format.htm)).

use crate::simulation_table::{SimulationTable, heading};
use mapper_core::{CompressorMap, ExportError, MapFormat};
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "gsp",
    extension: "gsp.map",
    description: "GSP and GasTurb tables of flow, pressure ratio and efficiency over beta and corrected speed",
    write: Some(write),
    read: Some(mapper_maps::table::read_any_bytes),
    ..MapFormat::NONE
};

const NUMBERS_PER_LINE: usize = 5;

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let table = SimulationTable::of(map, FORMAT.name)?;
    let about = heading(map, "99");
    // The title has one line; comments follow the tables.
    let (title, about) = about.split_once('\n').unwrap_or((&about, ""));
    let mut text = format!("{title}\nReynolds: RNI=0.100 f=1.000 RNI=1.000 f=1.000\n");
    for (name, values) in [
        ("Mass Flow", &table.flow_kg_s),
        ("Efficiency", &table.eta),
        ("Pressure Ratio", &table.pressure_ratio),
    ] {
        let _ = writeln!(text, "{name}");
        rows(&mut text, &table.beta, table.speeds_rpm.iter().copied().zip(values));
        text.push_str(" \n");
    }
    let surge =
        |values: &[Vec<f64>]| values.iter().filter_map(|row| row.last()).copied().collect::<Vec<f64>>();
    text.push_str("Surge Line\n");
    rows(&mut text, &surge(&table.flow_kg_s), [(1.0, &surge(&table.pressure_ratio))]);
    text.push_str(&about.replace("99 ", ""));
    text.push_str(&table.remarks("remark:"));
    text.push_str("remark: beta is 0 at choke, 1 at surge; speed: corrected, rpm; flow: corrected, kg/s\n");
    Ok(text.into_bytes())
}

/// A table: its size as `rows.columns`, the coordinates, then a number and its values in each row.
fn rows<'a>(text: &mut String, coordinates: &[f64], values: impl IntoIterator<Item = (f64, &'a Vec<f64>)>) {
    let values: Vec<(f64, &Vec<f64>)> = values.into_iter().collect();
    let size = format!("{}.{:03}", values.len() + 1, coordinates.len() + 1);
    row(text, size, coordinates);
    for (first, values) in values {
        row(text, first.to_string(), values);
    }
}

fn row(text: &mut String, first: String, values: &[f64]) {
    let words: Vec<String> = std::iter::once(first).chain(values.iter().map(f64::to_string)).collect();
    for line in words.chunks(NUMBERS_PER_LINE) {
        let _ = writeln!(text, "  {}", line.join("  "));
    }
}
