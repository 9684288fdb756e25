//! MATLAB data: matrices in a MAT-file of level 4, which MATLAB, Octave and SciPy read.
//!
//! "MAT-File Format" (MathWorks), chapter 2: each matrix is five 32-bit integers (type, rows, columns, imaginary part, length of the name), the
//! name with a zero behind it, and the numbers column by column. Level 4 has no structures, and needs no compression or alignment.

use crate::simulation_table::{SimulationTable, heading};
use mapper_core::{
    CompressorMap, ExportError, ImportError, ImportedMap, ImportedTurbine, MapDescription, MapFormat,
    TurbineFormat,
};
use mapper_maps::table::{
    DEFINITION_PREFIX, NamedArray, is_mat5, mat5_arrays, read_named_arrays, read_turbine_arrays,
};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "mat",
    extension: "mat",
    description: "MATLAB data: read to level 7 with structures; written in level 4 with the tables of the format simscape over corrected speed and beta, and the points",
    write: Some(write),
    read: Some(read),
    turbine: TurbineFormat { write: None, read: Some(read_turbine) },
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

/// The arrays of a file, and notes about the map: name, reference state and definition of the efficiency, as in the comments of text files.
fn arrays(bytes: &[u8]) -> Result<(Vec<NamedArray>, String), ImportError> {
    let matrices = matrices(bytes);
    if matrices.is_empty() && is_mat5(bytes) {
        return Ok((mat5_arrays(bytes)?, String::new()));
    }
    if matrices.is_empty() {
        return Err(ImportError::RowForm {
            line: 1,
            text: String::from_utf8_lossy(bytes.get(..10).unwrap_or(bytes)).into_owned(),
            form: "MATLAB data of version 4 to 7: save it by `save -v7`",
        });
    }
    let about = matrices.iter().find(|matrix| matrix.name == ABOUT);
    let about: String = about
        .iter()
        .flat_map(|matrix| &matrix.values)
        .filter_map(|code| char::from_u32(*code as u32))
        .collect();
    let is_note = |line: &&str| {
        ["compressor map of ", "reference state", DEFINITION_PREFIX].iter().any(|s| line.contains(s))
    };
    let notes = about.lines().filter(is_note).collect::<Vec<_>>().join("\n");
    let names = ["speed [rpm]", "flow [kg/s]", "PR", "efficiency"];
    let points = matrices.iter().find(|matrix| matrix.name == POINTS && matrix.columns == names.len());
    let Some(points) = points else { return Ok((matrices, notes)) };
    let column = |(at, name): (usize, &str)| {
        let values: Vec<f64> = points.values.iter().skip(at).step_by(names.len()).copied().collect();
        NamedArray { name: name.to_owned(), rows: values.len(), columns: 1, values }
    };
    Ok((names.into_iter().enumerate().map(column).collect(), notes))
}

fn read(bytes: &[u8], given: &MapDescription) -> Result<ImportedMap, ImportError> {
    let (arrays, notes) = arrays(bytes)?;
    read_named_arrays(&arrays, &notes, given)
}

fn read_turbine(bytes: &[u8], given: &MapDescription) -> Result<ImportedTurbine, ImportError> {
    let (arrays, notes) = arrays(bytes)?;
    read_turbine_arrays(&arrays, &notes, given)
}

/// The matrices of level 4; none if the bytes have another form.
fn matrices(mut bytes: &[u8]) -> Vec<NamedArray> {
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
        let values: Vec<f64> = data.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect();
        let name = String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
        found.push(NamedArray::of_columns(name, field(1), field(2), &values));
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
