//! MATLAB data: matrices in a MAT-file of level 4, which MATLAB, Octave and SciPy read.
//!
//! "MAT-File Format" (MathWorks), chapter 2: each matrix is five 32-bit integers (type, rows, columns, imaginary part, length of the name), the
//! name with a zero behind it, and the numbers column by column. Level 4 has no structures, and needs no compression or alignment.

use crate::heading::heading;
use crate::simulation_table::SimulationTable;
use mapper_core::{CompressorMap, ExportError, MapFormat};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "mat",
    extension: "mat",
    description: "MATLAB data (level 4): the tables of the format simscape over corrected speed and beta, and the points",
    write: Some(write),
    ..MapFormat::NONE
};

/// Numbers in 64 bits, the least significant byte first.
const NUMBERS: u32 = 0;
/// The same as the codes of characters.
const TEXT: u32 = 1;

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let table = SimulationTable::of(map, FORMAT.name)?;
    let mut file = Vec::new();
    let about = heading(map, "") + &table.remarks("");
    matrix(
        &mut file,
        "about",
        TEXT,
        &[about.trim().chars().map(|letter| f64::from(u32::from(letter))).collect()],
    );
    matrix(&mut file, "reference_temperature_K", NUMBERS, &[vec![map.reference.t_ref_k]]);
    matrix(&mut file, "reference_pressure_Pa", NUMBERS, &[vec![map.reference.p_ref_pa]]);
    matrix(&mut file, "corrected_speed_rpm", NUMBERS, std::slice::from_ref(&table.speeds_rpm));
    matrix(&mut file, "beta", NUMBERS, std::slice::from_ref(&table.beta));
    matrix(&mut file, "pressure_ratio", NUMBERS, &table.pressure_ratio);
    matrix(&mut file, "corrected_flow_kg_s", NUMBERS, &table.flow_kg_s);
    matrix(&mut file, "isentropic_efficiency", NUMBERS, &table.eta);
    // A row for each point; NaN is an efficiency that could not be identified.
    let points: Vec<Vec<f64>> = map
        .lines
        .iter()
        .flat_map(|line| line.points.iter().map(move |point| (line.speed_corrected_rpm, point)))
        .map(|(speed_rpm, point)| {
            let eta = point.eta.unwrap_or(f64::NAN);
            vec![speed_rpm, point.flow_corrected_kg_s, point.pressure_ratio, eta]
        })
        .collect();
    matrix(&mut file, "points_rpm_kg_s_pressure_ratio_efficiency", NUMBERS, &points);
    Ok(file)
}

/// Appends a matrix, given by its rows of equal length.
fn matrix(file: &mut Vec<u8>, name: &str, kind: u32, rows: &[Vec<f64>]) {
    let columns = rows.first().map_or(0, Vec::len);
    // A map has some thousand numbers.
    let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
    for number in [kind, count(rows.len()), count(columns), 0, count(name.len() + 1)] {
        file.extend(number.to_le_bytes());
    }
    file.extend(name.bytes());
    file.push(0);
    for column in 0..columns {
        file.extend(rows.iter().flat_map(|row| row[column].to_le_bytes()));
    }
}
