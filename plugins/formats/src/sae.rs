//! SAE text of a compressor (J1826, J922) in the columns of suppliers: a title, the wheel's diameters, the names of the columns, then rows of
//! four fields of ten characters (corrected rpm, corrected kg/s, pressure ratio, efficiency) from surge to choke, and the surge line.
//!
//! Readers take the fields by column (EngineToolBox, from line 4) or by blanks (OpenWAM): each field begins with a blank and has a decimal
//! point, without which Fortran would shift the digits. What ten characters cannot hold is in the companion file.

use mapper_core::{CompressorMap, ExportError, MapFormat, one_line};
use mapper_maps::table::{CORRECTED_TO, DEFINITION_PREFIX, UNNAMED_MACHINE, read_any_bytes};
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "sae",
    extension: "txt",
    further_extensions: &["map", "sae", "dat", "cmp", "tsv", "prn"],
    description: "SAE text: corrected rpm, corrected kg/s, pressure ratio, efficiency in columns of ten; and NAME.points.csv with all digits and intervals",
    write: Some(write),
    read: Some(read_any_bytes),
    companion: Some(("points.csv", crate::csv::write)),
    turbine: crate::turbine::TEXT,
    ..MapFormat::NONE
};

/// Width of a field. Source: files of suppliers, and the reader of EngineToolBox (`%10s`).
pub(crate) const WIDTH: usize = 10;

/// A number in a field, with as many digits as fit behind a blank.
pub(crate) fn field(value: f64) -> String {
    let exact = value.to_string();
    let exact = if exact.contains('.') { exact } else { exact + ".0" };
    let fitting = (exact.len() < WIDTH).then_some(exact);
    let rounded =
        || (0..WIDTH).rev().map(|digits| format!("{value:.digits$}")).find(|text| text.len() < WIDTH);
    let text = fitting.or_else(rounded).unwrap_or_default();
    format!("{text:>WIDTH$}")
}

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let all = || map.lines.iter().flat_map(|line| &line.points);
    let without = all().filter(|point| point.eta.is_none()).count();
    // A map without any efficiency has three columns; the heading names them for the reader.
    let has_eta = without < all().count();
    let machine = if map.machine.is_empty() { UNNAMED_MACHINE.to_owned() } else { one_line(&map.machine) };
    let mut text =
        format!("{machine}{CORRECTED_TO}{} K, {} Pa", map.reference.t_ref_k, map.reference.p_ref_pa);
    if without > 0 && has_eta {
        let _ = write!(text, "; {without} points without efficiency left out");
    }
    if let Some(definition) = map.efficiency {
        let _ = write!(text, "; {DEFINITION_PREFIX}{definition}");
    }
    // Of the wheel and of its inlet, which a map does not have.
    let _ = writeln!(text, "\n{}{}", field(map.wheel_diameter_m.unwrap_or(0.0)), field(0.0));
    let _ = writeln!(text, "   N [rpm]  m [kg/s]        PR{}", if has_eta { "       eff" } else { "" });
    for line in &map.lines {
        for point in line.points.iter().filter(|point| point.eta.is_some() || !has_eta) {
            let numbers = [line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio];
            text.extend(numbers.into_iter().chain(point.eta).map(field));
            text.push('\n');
        }
    }
    if !map.surge.is_empty() {
        text.push_str("\n\n\nSurge Line\n");
    }
    for mark in &map.surge {
        let numbers = [mark.speed_corrected_rpm, mark.flow_corrected_kg_s, mark.pressure_ratio];
        text.extend(numbers.map(field));
        text.push('\n');
    }
    Ok(text.into_bytes())
}
