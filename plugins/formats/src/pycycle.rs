//! pyCycle: a module with a map in the layout of `pycycle.maps`, `[alpha][Nc][Rline]`.
//!
//! Rline runs from 1 at surge (`RlineStall`) to 3 at choke. pyCycle scales a map to its design point: any units are valid
//! if they are declared (`units`).

use crate::simulation_table::{SimulationTable, heading, joined};
use mapper_core::{CompressorMap, ExportError, MapFormat};
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "pycycle",
    extension: "py",
    description: "Python module with a pyCycle map: [alpha][Nc][Rline]",
    write: Some(write),
    read: Some(mapper_maps::table::read_any_bytes),
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let table = SimulationTable::of(map, FORMAT.name)?;
    let mut text = format!("{}{}", heading(map, "#"), table.remarks("#"));
    text.push_str(
        "# NcMap: corrected speed, rpm; WcMap: corrected flow, kg/s; Rline 1 at surge, 3 at choke\n\
         import numpy as np\n\n\
         try:\n    from pycycle.maps.map_data import MapData\n\
         except ImportError:  # readable without pyCycle\n    class MapData:\n        pass\n\n\
         compressor = MapData()\n",
    );
    let (speed_index, column) = find_best_efficiency(&table);
    let columns = table.beta.len();
    let rline = |column: usize| 3.0 - 2.0 * table.beta[column];
    let _ = writeln!(
        text,
        "compressor.defaults = {{'alphaMap': 0.0, 'NcMap': {}, 'PR': {}, 'RlineMap': {}}}",
        table.speeds_rpm[speed_index],
        table.pressure_ratio[speed_index][column],
        rline(column)
    );
    text.push_str("compressor.RlineStall = 1.0\ncompressor.alphaMap = np.array([0.0, 90.0])\n");
    let _ = writeln!(text, "compressor.NcMap = np.array([{}])", joined(&table.speeds_rpm, ", "));
    // Surge first: Rline rises.
    let rlines: Vec<f64> = (0..columns).rev().map(rline).collect();
    let _ = writeln!(text, "compressor.RlineMap = np.array([{}])", joined(&rlines, ", "));
    for (name, values) in
        [("WcMap", &table.flow_kg_s), ("effMap", &table.eta), ("PRmap", &table.pressure_ratio)]
    {
        let _ = writeln!(text, "compressor.{name} = np.array([[");
        for row in values {
            let reversed: Vec<f64> = row.iter().rev().copied().collect();
            let _ = writeln!(text, "    [{}],", joined(&reversed, ", "));
        }
        // The same at both vane angles: the machine has no vanes.
        text.push_str("]] * 2)\n");
    }
    text.push_str(LISTS);
    Ok(text.into_bytes())
}

/// Inputs of the interpolator in pyCycle 4's `CompressorMap`.
const LISTS: &str = "\
compressor.Npts = compressor.NcMap.size
compressor.units = {'NcMap': 'rpm', 'WcMap': 'kg/s'}
compressor.param_data = [
    {'name': 'alphaMap', 'values': compressor.alphaMap, 'default': 0.0, 'units': None},
    {'name': 'NcMap', 'values': compressor.NcMap, 'default': compressor.defaults['NcMap'], 'units': 'rpm'},
    {'name': 'RlineMap', 'values': compressor.RlineMap, 'default': compressor.defaults['RlineMap'], 'units': None},
]
compressor.output_data = [
    {'name': name, 'values': values, 'default': np.mean(values), 'units': compressor.units.get(name)}
    for name, values in (
        ('WcMap', compressor.WcMap), ('effMap', compressor.effMap), ('PRmap', compressor.PRmap))
]
";

/// Speed and column of the best efficiency, as pyCycle's initial design point.
fn find_best_efficiency(table: &SimulationTable) -> (usize, usize) {
    let mut best = (0, 0);
    for (i, row) in table.eta.iter().enumerate() {
        for (j, eta) in row.iter().enumerate() {
            if *eta > table.eta[best.0][best.1] {
                best = (i, j);
            }
        }
    }
    best
}
