//! MATLAB data: matrices in a MAT-file of level 4, which MATLAB, Octave and SciPy read.
//!
//! "MAT-File Format" (MathWorks), chapter 2: each matrix is five 32-bit integers (type, rows, columns, imaginary part, length of the name), the
//! name with a zero behind it, and the numbers column by column. Level 4 has no structures, and needs no compression or alignment.

use crate::simulation_table::{SimulationTable, digits, heading};
use mapper_core::{CompressorMap, ExportError, ImportError, ImportedMap, MapDescription, MapFormat};
use mapper_maps::table::{DEFINITION_PREFIX, read_text};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "mat",
    extension: "mat",
    description: "MATLAB data (level 4): the tables of the format simscape over corrected speed and beta, and the points",
    write: Some(write),
    read: Some(read),
    ..MapFormat::NONE
};

/// Name of the matrix of points: speed, flow, pressure ratio, efficiency.
const POINTS: &str = "points_rpm_kg_s_pressure_ratio_efficiency";
/// Name of the text about the map.
const ABOUT: &str = "about";

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
        ABOUT,
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
    matrix(&mut file, POINTS, NUMBERS, &points);
    Ok(file)
}

fn read(bytes: &[u8], given: &MapDescription) -> Result<ImportedMap, ImportError> {
    let matrices = matrices(bytes);
    let points = matrices.iter().find(|matrix| matrix.name == POINTS && matrix.rows.len() % 4 == 0);
    let Some(points) = points else {
        return Err(ImportError::RowForm {
            line: 1,
            text: String::from_utf8_lossy(bytes.get(..10).unwrap_or(bytes)).into_owned(),
            form: "a map that this program wrote; in MATLAB save the columns as a table: writetable(struct2table(map), 'map.csv')",
        });
    };
    let count = points.rows.len() / 4;
    let about = matrices.iter().find(|matrix| matrix.name == ABOUT);
    let about: String = about
        .iter()
        .flat_map(|matrix| &matrix.rows)
        .filter_map(|code| char::from_u32(*code as u32))
        .collect();
    // Name, reference state and definition of the efficiency, as in the comments of text files.
    let is_note = |line: &&str| {
        ["compressor map of ", "reference state", DEFINITION_PREFIX].iter().any(|s| line.contains(s))
    };
    let mut text: String = about.lines().filter(is_note).map(|line| format!("# {line}\n")).collect();
    text += "speed [rpm];flow [kg/s];PR;efficiency\n";
    for row in 0..count {
        let value = |column: usize| points.rows.get(column * count + row).copied().filter(|v| v.is_finite());
        text += &([0, 1, 2, 3].map(|column| digits(value(column))).join(";") + "\n");
    }
    read_text(&text, given)
}

struct Matrix {
    name: String,
    rows: Vec<f64>,
}

fn matrices(mut bytes: &[u8]) -> Vec<Matrix> {
    let mut found = Vec::new();
    while let Some((header, rest)) = bytes.split_at_checked(20) {
        let field = |at: usize| {
            let field = header.get(4 * at..4 * at + 4).and_then(|field| field.try_into().ok());
            field.map_or(0, u32::from_le_bytes) as usize
        };
        let length = field(1).checked_mul(field(2)).and_then(|count| count.checked_mul(8));
        let is_level_4 = field(0) <= TEXT as usize && field(3) == 0;
        let Some(length) = length.filter(|_| is_level_4) else { break };
        let Some((name, rest)) = rest.split_at_checked(field(4)) else { break };
        let Some((data, rest)) = rest.split_at_checked(length) else { break };
        let rows = data.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect();
        let name = String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
        found.push(Matrix { name, rows });
        bytes = rest;
    }
    found
}

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
