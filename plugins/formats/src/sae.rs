//! SAE text, compressor (J1826, J922): `#` comments, then corrected rpm, corrected kg/s, pressure ratio, efficiency in a
//! row, from choke to surge within a line.
//!
//! Manufacturers' files may begin with a title, wheel diameters and column names: [`mapper_maps::table`] reads them.

use crate::simulation_table::heading;

use mapper_core::{CompressorMap, ExportError, MapFormat};
use mapper_maps::table::read_any_bytes;
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "sae",
    extension: "txt",
    further_extensions: &["map", "sae", "dat", "cmp", "tsv", "prn"],
    description: "SAE text: corrected rpm, corrected kg/s, pressure ratio, efficiency, from choke to surge",
    write: Some(write),
    read: Some(read_any_bytes),
    turbine: crate::turbine::TEXT,
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let mut text = heading(map, "#");
    let all = || map.lines.iter().flat_map(|line| &line.points);
    let without = all().filter(|point| point.eta.is_none()).count();
    // A map without any efficiency has three columns; a heading names them for the reader.
    let has_eta = without < all().count();
    if without > 0 && has_eta {
        let _ = writeln!(
            text,
            "# {without} points without efficiency are left out: the format has no place for them"
        );
    }
    let _ = writeln!(text, "# N(rpm) mdot(kg/s) PR{}", if has_eta { " Eff" } else { "" });
    for line in &map.lines {
        // Points are stored by rising flow; the format goes from choke to surge.
        for point in line.points.iter().rev() {
            let eta = match point.eta {
                None if has_eta => continue,
                eta => eta.map_or_else(String::new, |eta| format!(" {eta}")),
            };
            // Shortest text that reads back to the same number.
            let (speed_rpm, flow_kg_s) = (line.speed_corrected_rpm, point.flow_corrected_kg_s);
            let _ = writeln!(text, "{speed_rpm} {flow_kg_s} {}{eta}", point.pressure_ratio);
        }
    }
    Ok(text.into_bytes())
}
