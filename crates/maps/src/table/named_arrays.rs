//! Reads maps from named arrays of numbers: variables and structures of MATLAB, JSON, TOML. Vectors of equal length are a table of points,
//! matrices are tables over speed and an auxiliary coordinate.

use crate::table::beta_tables::{BetaTables, NamedArray};
use crate::table::quantity::end_in;
use crate::table::read::read_text;
use crate::table::read_turbine::read_turbine_text;
use crate::table::rows_to_lines::MAX_POINTS;
use mapper_core::{ImportError, ImportedMap, ImportedTurbine, LineEnd, MapDescription};
use mapper_table::{ColumnName, MatArray, Word, read_mat5};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Memory of the arrays of a file, bytes. Bound: twice the largest map file.
const MAX_MEMORY_BYTES: u64 = 2 * mapper_core::MAP_FILE_SIZE_LIMIT as u64;

/// Maximum number of arrays. Bound: a record of four numbers for each point.
const MAX_ARRAYS: usize = 4 * MAX_POINTS;
/// Maximum number of columns. Bound: a map of all channels of a stand.
const MAX_COLUMNS: usize = 200;
/// Maximum number of texts that are searched for the reference state. Bound: a heading.
const MAX_NOTES: usize = 100;

/// The arrays of MATLAB data of level 5 to 7.
pub fn mat5_arrays(bytes: &[u8]) -> Result<Vec<NamedArray>, ImportError> {
    let file = read_mat5(bytes, MAX_MEMORY_BYTES).map_err(|problem| ImportError::Packed { problem })?;
    let array =
        |array: MatArray| NamedArray::of_columns(array.name, array.rows, array.columns, &array.values);
    Ok(file.arrays.into_iter().map(array).collect())
}

/// The map of a JSON document that this program did not write: columns, records, lines or tables.
pub fn read_json_map(document: &Value, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let (mut arrays, mut texts) = (Vec::new(), BTreeMap::new());
    collect("", document, &mut arrays, &mut texts);
    for array in &mut arrays {
        // `"flow": {"unit": "lb/s", "values": [...]}`, or `"units": {"flow": "lb/s"}`. An unknown unit is reported as in a heading.
        let (structure, own) = array.name.rsplit_once('.').unwrap_or(("", &array.name));
        let is_wrapped = !structure.is_empty() && ["values", "value", "data"].contains(&own);
        let places = match is_wrapped {
            true => [format!("{structure}.unit"), format!("{structure}.units")],
            false => [format!("{structure}.units.{own}"), format!("units.{own}")],
        };
        let name = if is_wrapped { structure } else { &array.name };
        let unit = places.iter().find_map(|place| texts.get(place.trim_start_matches('.')));
        array.name = unit.map_or_else(|| name.to_owned(), |unit| format!("{name} [{unit}]"));
    }
    let notes: Vec<String> =
        texts.iter().take(MAX_NOTES).map(|(name, text)| format!("{name}: {text}")).collect();
    read_named_arrays(&arrays, &notes.join("\n"), description)
}

/// Adds the arrays of numbers and the texts of a value with their paths.
fn collect(path: &str, value: &Value, arrays: &mut Vec<NamedArray>, texts: &mut BTreeMap<String, String>) {
    let numbers = |list: &[Value]| {
        let number = |value: &Value| if value.is_null() { Some(f64::NAN) } else { value.as_f64() };
        list.iter().map(number).collect::<Option<Vec<f64>>>().filter(|found| !found.is_empty())
    };
    match value {
        // `{"45000": {...}, "75000": {...}}`: lines named after their speeds.
        Value::Object(fields)
            if fields.iter().all(|(key, line)| key.parse::<f64>().is_ok() && line.is_object()) =>
        {
            for (index, (key, line)) in fields.iter().enumerate() {
                let path = format!("{path}({})", index + 1);
                let values = key.parse().into_iter().collect();
                arrays.push(NamedArray { name: format!("{path}.speed"), rows: 1, columns: 1, values });
                collect(&path, line, arrays, texts);
            }
        }
        Value::Object(fields) => {
            for (key, field) in fields {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                collect(&path, field, arrays, texts);
            }
        }
        Value::Array(list) => {
            if let Some(values) = numbers(list) {
                arrays.push(NamedArray { name: path.to_owned(), rows: values.len(), columns: 1, values });
                return;
            }
            let rows: Option<Vec<Vec<f64>>> = list.iter().map(|row| numbers(row.as_array()?)).collect();
            let width = rows.as_ref().and_then(|rows| rows.first()).map_or(0, Vec::len);
            match rows.filter(|rows| rows.iter().all(|row| row.len() == width)) {
                Some(rows) => arrays.push(NamedArray {
                    name: path.to_owned(),
                    rows: rows.len(),
                    columns: width,
                    values: rows.concat(),
                }),
                None => {
                    for (index, element) in list.iter().enumerate() {
                        collect(&format!("{path}({})", index + 1), element, arrays, texts);
                    }
                }
            }
        }
        Value::Number(number) => {
            let values = vec![number.as_f64().unwrap_or(f64::NAN)];
            arrays.push(NamedArray { name: path.to_owned(), rows: 1, columns: 1, values });
        }
        Value::String(text) => {
            texts.insert(path.to_owned(), text.clone());
        }
        Value::Null | Value::Bool(_) => {}
    }
}

/// The map of named arrays; `notes` are lines of text about it.
pub fn read_named_arrays(
    arrays: &[NamedArray],
    notes: &str,
    description: &MapDescription,
) -> Result<ImportedMap, ImportError> {
    let is_table = |array: &&NamedArray| array.is_matrix() && end_in(&array.name).is_none();
    let matrices: Vec<&NamedArray> = arrays.iter().filter(is_table).collect();
    if let [points] = matrices.as_slice()
        && arrays.iter().all(|array| array.values.len() < 2 || array == *points)
    {
        let rows = points.values.chunks(points.columns).map(|row| joined(row.iter().copied()));
        return read_text(&(comments(notes) + &rows.collect::<String>()), description);
    }
    if !matrices.is_empty() {
        return BetaTables::of_arrays(arrays).map(notes, &scalars(arrays, notes), description);
    }
    match points_text(arrays, notes)? {
        (_, Some(text)) => Err(ImportError::Turbine { line: 1, text }),
        (text, None) => read_text(&text, description),
    }
}

/// The turbine map of named arrays.
pub fn read_turbine_arrays(
    arrays: &[NamedArray],
    notes: &str,
    description: &MapDescription,
) -> Result<ImportedTurbine, ImportError> {
    read_turbine_text(&points_text(arrays, notes)?.0, description)
}

fn comments(notes: &str) -> String {
    notes.lines().map(|line| format!("# {line}\n")).collect()
}

/// The vectors of the points as a table, and the name of their structure if it is a turbine's.
fn points_text(arrays: &[NamedArray], notes: &str) -> Result<(String, Option<String>), ImportError> {
    let vectors = whole_vectors(arrays)?;
    // The points are the most vectors of one length in one structure.
    let mut groups: BTreeMap<(bool, &str, usize), Vec<&Vector>> = BTreeMap::new();
    for vector in vectors.iter().filter(|vector| vector.values.len() > 1 && end_in(&vector.name).is_none()) {
        let is_of_turbine = ColumnName::read(&vector.structure).has(Word::Turbine);
        groups.entry((!is_of_turbine, &vector.structure, vector.values.len())).or_default().push(vector);
    }
    let most = groups.into_iter().max_by_key(|((is_compressor, ..), group)| (*is_compressor, group.len()));
    let ((is_compressor, structure, count), points) = most.ok_or(ImportError::Empty)?;
    let row = |columns: &[Option<&Vec<f64>>], at: usize| {
        joined(
            columns
                .iter()
                .map(|column| column.and_then(|values| values.get(at).copied()).unwrap_or(f64::NAN)),
        )
    };
    let names: Vec<&str> = points.iter().map(|vector| vector.name.as_str()).collect();
    let mut text = comments(notes) + &names.join(";") + "\n";
    let columns: Vec<Option<&Vec<f64>>> = points.iter().map(|vector| Some(&vector.values)).collect();
    text.extend((0..count).map(|at| row(&columns, at)));
    // `RPM_surge` belongs to the column `RPM`.
    let of_surge = |name: &&str| {
        let is_own = |vector: &&Vector| {
            let (other, name) = (vector.name.to_lowercase(), name.to_lowercase());
            vector.structure == structure
                && end_in(&other) == Some(LineEnd::Surge)
                && (other.starts_with(&name) || other.ends_with(&name))
        };
        vectors.iter().find(is_own).map(|vector| &vector.values)
    };
    let surge: Vec<Option<&Vec<f64>>> = names.iter().map(of_surge).collect();
    let count = surge.iter().flatten().map(|values| values.len()).max().unwrap_or_default();
    if count > 0 {
        text += "Surge line\n";
        text.extend((0..count).map(|at| row(&surge, at)));
    }
    let turbine = (!is_compressor).then(|| structure.to_owned());
    Ok((text, turbine))
}

fn joined(row: impl Iterator<Item = f64>) -> String {
    let cell = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
    row.map(cell).collect::<Vec<_>>().join(";") + "\n"
}

/// The single numbers as text of a script, where a design point may be.
fn scalars(arrays: &[NamedArray], notes: &str) -> String {
    let single = arrays.iter().filter_map(|array| match array.values.as_slice() {
        [value] => Some(format!("{} = {value}\n", array.own_name())),
        _ => None,
    });
    single.chain([notes.to_owned()]).collect()
}

struct Vector {
    /// The structure around it, without the numbers of elements.
    structure: String,
    name: String,
    values: Vec<f64>,
}

/// The vectors; those of the elements of a structure follow each other, a single number stands for every point of its element.
fn whole_vectors(arrays: &[NamedArray]) -> Result<Vec<Vector>, ImportError> {
    let arrays = &with_outer_numbers(arrays)?;
    let mut lengths: BTreeMap<&str, usize> = BTreeMap::new();
    for array in arrays {
        let length = lengths.entry(array.element()).or_default();
        *length = array.values.len().max(*length);
    }
    let (mut vectors, mut total): (Vec<Vector>, usize) = (Vec::new(), 0);
    for array in arrays {
        let (element, name) = (array.element(), array.own_name().to_owned());
        let structure = if element.is_empty() { array.structure() } else { element };
        let structure = structure.split('(').next().unwrap_or_default().to_owned();
        let is_single = array.values.len() == 1 && !element.is_empty();
        let count = if is_single { lengths.get(element).copied().unwrap_or(1) } else { array.values.len() };
        total += count;
        if total > MAX_COLUMNS * MAX_POINTS {
            return Err(ImportError::TooMany { line: 1, limit: MAX_POINTS });
        }
        let values: Vec<f64> = array.values.iter().copied().cycle().take(count).collect();
        let is_full = vectors.len() >= MAX_COLUMNS;
        match vectors
            .iter_mut()
            .find(|known| known.name == name && known.structure == structure && !element.is_empty())
        {
            Some(known) => known.values.extend(values),
            None if is_full => return Err(ImportError::TooMany { line: 1, limit: MAX_COLUMNS }),
            None => vectors.push(Vector { structure, name, values }),
        }
    }
    Ok(vectors)
}

/// The arrays; a single number of an element that has elements inside, as the speed of a line with its points, stands in each of them.
fn with_outer_numbers(arrays: &[NamedArray]) -> Result<Vec<NamedArray>, ImportError> {
    let elements: BTreeSet<&str> = arrays.iter().map(NamedArray::element).collect();
    let mut all = Vec::new();
    for array in arrays {
        let outer = format!("{}.", array.element());
        let is_single = array.values.len() == 1 && outer.len() > 1;
        let inner: Vec<&&str> =
            elements.range(outer.as_str()..).take_while(|it| is_single && it.starts_with(&outer)).collect();
        all.extend(inner.is_empty().then(|| array.clone()));
        let copy =
            |element: &&str| NamedArray { name: format!("{element}.{}", array.own_name()), ..array.clone() };
        if all.len() + inner.len() > MAX_ARRAYS {
            return Err(ImportError::TooMany { line: 1, limit: MAX_ARRAYS });
        }
        all.extend(inner.into_iter().map(copy));
    }
    Ok(all)
}
