//! Reads sheets of Excel workbooks, and the text of a map file that may be compressed or a workbook.

use crate::table::quantity::end_in;
use crate::table::sheet::grid::{Grid, GridRow, MAX_ROWS, count_number_cells, text_of};
use crate::table::sheet::headings::without_speed;
use crate::table::sheet::points::{points_of_matrices, quantity_of_title};
use mapper_core::unit_factors::PERCENT;
use mapper_core::{ImportError, MAP_FILE_SIZE_LIMIT};
use mapper_table::{Book, Value, XlsxLimits, decimal_sign_of_cells, is_workbook, parse_number};
use std::borrow::Cow;
use std::io::{Cursor, Read};

/// The cells of the named sheet, else of the first visible sheet with a table of numbers, else of a hidden one.
pub(crate) fn grid_of_workbook(bytes: &[u8], wanted: Option<&str>) -> Result<Grid, ImportError> {
    let mut sheets = sheets_of(bytes)?;
    let has_table =
        |sheet: &Sheet| sheet.rows.iter().filter(|row| count_number_cells(&row.cells) >= 3).count() >= 2;
    let is_end = |sheet: &Sheet| wanted.is_none() && end_in(&sheet.name).is_some();
    let is_wanted = |sheet: &Sheet| match wanted {
        Some(name) => sheet.name == name,
        None => !sheet.is_hidden && !is_end(sheet),
    };
    // A sheet for each speed line, named after its speed.
    let speed_rpm = |sheet: &Sheet| {
        let (rest, speed_rpm) = without_speed(&Grid::of_rows(Vec::new()), &sheet.name)?;
        (rest.is_empty() || sheet.name.to_lowercase().contains("rpm")).then_some(speed_rpm)
    };
    let visible = sheets.iter_mut().filter(|sheet| !sheet.is_hidden && has_table(sheet));
    let mut lines: Vec<(f64, &mut Sheet)> =
        visible.filter_map(|sheet| Some((speed_rpm(sheet)?, sheet))).collect();
    if wanted.is_none() && lines.len() > 1 {
        let title = |rpm: f64| GridRow { at: 1, cells: vec![format!("{rpm} rpm")], is_comment: false };
        let rows = lines.iter_mut().flat_map(|(rpm, sheet)| {
            std::iter::once(title(*rpm)).chain(std::mem::take(&mut sheet.rows)).collect::<Vec<_>>()
        });
        return Ok(Grid::of_rows(rows.collect()));
    }
    // A sheet for each quantity, named after it.
    if wanted.is_none() {
        let matrices =
            sheets.iter().filter(|sheet| !sheet.is_hidden && quantity_of_title(&sheet.name).is_some());
        let titled = matrices.flat_map(|sheet| {
            let title = GridRow { at: 1, cells: vec![sheet.name.clone()], is_comment: false };
            std::iter::once(title).chain(sheet.rows.iter().cloned())
        });
        let joined = Grid::of_rows(titled.collect());
        if points_of_matrices(&joined).is_some() {
            return Ok(joined);
        }
    }
    if let Some(table) = sheets.iter_mut().find(|sheet| is_wanted(sheet) && has_table(sheet)) {
        let mut rows = std::mem::take(&mut table.rows);
        // A sheet with the surge line is a block below the table.
        for sheet in sheets.iter_mut().filter(|sheet| !sheet.is_hidden && is_end(sheet)) {
            rows.push(GridRow { at: 1, cells: vec![sheet.name.clone()], is_comment: false });
            rows.append(&mut sheet.rows);
        }
        return Ok(Grid::of_rows(rows));
    }
    // Hidden sheets usually have obsolete data: one counts only if it is named, or has the only table.
    let mut hidden: Vec<&mut Sheet> =
        sheets.iter_mut().filter(|sheet| sheet.is_hidden && has_table(sheet)).collect();
    if let (None, [only]) = (wanted, hidden.as_mut_slice()) {
        return Ok(Grid::of_rows(std::mem::take(&mut only.rows)));
    }
    let hidden: Vec<String> = hidden.iter().map(|sheet| sheet.name.clone()).collect();
    let names: Vec<&str> = sheets.iter().map(|sheet| sheet.name.as_str()).collect();
    let missing = wanted.map_or("no visible sheet".to_owned(), |name| format!("no sheet `{name}`"));
    let mut problem = format!("{missing} has rows of at least three numbers; sheets: {}", names.join(", "));
    if !hidden.is_empty() {
        problem += &format!("; hidden ones with such rows: {} (name one with `sheet`)", hidden.join(", "));
    }
    Err(ImportError::Workbook { problem })
}

struct Sheet {
    name: String,
    is_hidden: bool,
    rows: Vec<GridRow>,
}

/// Maximum number of cells of a sheet, empty ones between others included. Bound: 100 000 points with 40 columns.
const MAX_SHEET_CELLS: usize = 40 * MAX_ROWS;

fn sheets_of(bytes: &[u8]) -> Result<Vec<Sheet>, ImportError> {
    let failed = |problem: String| ImportError::Workbook { problem };
    let limits = XlsxLimits { unpacked_bytes: MAX_UNPACKED_BYTES, memory_bytes: MAX_UNPACKED_BYTES };
    let mut book = Book::open(Cursor::new(bytes), limits).map_err(failed)?;
    // Limits the memory: many cells may share one long text.
    let mut left_bytes = MAX_UNPACKED_BYTES as usize;
    let mut sheets = Vec::new();
    for (name, is_hidden) in book.sheets() {
        let Some(mut rows) = book.rows(&name) else { continue };
        let (mut numbers, mut cells, mut left) = (Vec::new(), Vec::new(), MAX_SHEET_CELLS);
        while rows.advance().map_err(failed)? {
            let row = rows.row();
            let too_many =
                || failed(format!("sheet `{name}` has more than {MAX_SHEET_CELLS} cells; no map needs that"));
            left = left.checked_sub(row.len()).ok_or_else(too_many)?;
            let text_bytes: usize = row.iter().map(Value::text_bytes).sum();
            left_bytes = left_bytes.checked_sub(text_bytes).ok_or_else(|| failed(too_large()))?;
            if cells.len() < 2 * MAX_ROWS {
                numbers.push(rows.number());
                cells.push(row.to_vec());
            }
        }
        let decimal = decimal_sign_of_cells(&cells);
        let filled = |row: &Vec<Value>| row.iter().position(|cell| !cell.is_empty());
        let first = cells.iter().filter_map(filled).min().unwrap_or_default();
        let texts =
            |row: &Vec<Value>| row.iter().skip(first).map(|cell| text_of_cell(cell, decimal)).collect();
        let rows = numbers.iter().zip(&cells).map(|(at, row)| GridRow {
            at: *at,
            cells: texts(row),
            is_comment: false,
        });
        let rows =
            rows.filter(|row| row.cells.iter().any(|cell| cell.contains(char::is_alphanumeric))).collect();
        sheets.push(Sheet { name, is_hidden, rows });
    }
    Ok(sheets)
}

/// A cell as text with decimal points; numbers that are stored as text may have another decimal sign.
fn text_of_cell(cell: &Value, decimal: u8) -> String {
    match cell {
        Value::Text(text) if decimal == b',' => {
            parse_number(text.as_bytes(), decimal).map_or_else(|| text.clone(), |number| number.to_string())
        }
        cell => cell.text(b'.'),
    }
}

/// Maximum unpacked size of a workbook, bytes. Bound: 100 000 points with 20 columns of 30 bytes.
const MAX_UNPACKED_BYTES: u64 = 64 << 20;

fn too_large() -> String {
    format!("it unpacks to more than {} MB; no map needs that", MAX_UNPACKED_BYTES >> 20)
}

/// The text of a map file; of a workbook, its sheet with numbers as CSV.
pub fn file_text(bytes: &[u8]) -> Result<String, ImportError> {
    let bytes = unpack(bytes)?;
    if is_workbook(&bytes) { Ok(grid_of_workbook(&bytes, None)?.csv()) } else { text_of(&bytes) }
}

/// One text of files with a speed line each, named after its speed or as the surge line (`45000.csv`, `surge.csv`), as digitisers write them. Files
/// named after an efficiency (`eta_0.72.csv`) are its contours: where they cross a line, it has a point with that efficiency.
pub fn text_of_lines(files: &[(String, Vec<u8>)]) -> Result<String, ImportError> {
    let mut lines: Vec<(f64, String, Grid)> = Vec::new();
    let mut contours: Vec<(f64, Vec<[f64; 2]>)> = Vec::new();
    for (name, bytes) in files {
        let mut grid = Grid::of_text(&text_of(&unpack(bytes)?)?)?;
        grid.rows.retain(|row| !row.is_comment);
        match without_speed(&grid, name) {
            Some((_, speed_rpm)) => lines.push((speed_rpm, format!("{speed_rpm} rpm"), grid)),
            None if end_in(name).is_some() => lines.push((f64::INFINITY, name.clone(), grid)),
            None => match efficiency_in(name) {
                Some(eta) => contours.push((eta, grid.places())),
                None => {
                    let form = "the speed of a line, as in `45000.csv`, an efficiency (`eta_0.72.csv`) or `surge.csv`";
                    return Err(ImportError::RowForm { line: 1, text: name.clone(), form });
                }
            },
        }
    }
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut text = String::new();
    for (_, title, grid) in &lines {
        let is_name = |row: &&GridRow| row.cells.iter().any(|cell| cell.contains(char::is_alphabetic));
        let heading = grid.rows.iter().find(is_name);
        let width = grid.rows.iter().map(|row| row.cells.len()).max().unwrap_or_default();
        if width == 2 && !contours.is_empty() {
            let names = heading.map_or_else(|| "Q,PR".to_owned(), |row| row.cells.join(","));
            text += &format!("{title}\n{names},efficiency\n");
            let line = grid.places();
            line.iter().for_each(|[flow, ratio]| text += &format!("{flow},{ratio},\n"));
            for (eta, contour) in &contours {
                crossings(&line, contour)
                    .for_each(|[flow, ratio]| text += &format!("{flow},{ratio},{eta}\n"));
            }
            continue;
        }
        // `Q` is a flow without a unit, which the user has to state.
        let names = match (heading, width) {
            (Some(_), _) => "",
            (None, ..=2) => "Q,PR\n",
            (None, _) => "Q,PR,efficiency\n",
        };
        text += &format!("{title}\n{names}{}", grid.csv());
    }
    Ok(text)
}

/// Range of the efficiency of a contour. Bound: figures have no others.
const CONTOUR_ETAS: std::ops::RangeInclusive<f64> = 0.2..=0.95;

/// The efficiency that a file is named after: `eta_0.72`, `72%`, `eff70`.
fn efficiency_in(name: &str) -> Option<f64> {
    let lower = name.to_lowercase();
    let is_digit = |c: char| c.is_ascii_digit() || c == '.';
    let number: f64 = lower.split(|c| !is_digit(c)).find_map(|word| word.parse().ok())?;
    let is_named = ["eta", "eff", "η", "island", "wirkungsgrad", "rendement", "%"]
        .iter()
        .any(|word| lower.contains(word));
    let eta = if number > 1.0 { number / PERCENT } else { number };
    (CONTOUR_ETAS.contains(&eta) && (is_named || number < 1.0)).then_some(eta)
}

/// The places where two polylines cross.
fn crossings<'a>(a: &'a [[f64; 2]], b: &'a [[f64; 2]]) -> impl Iterator<Item = [f64; 2]> + 'a {
    let between = |from: [f64; 2], to: [f64; 2]| [to[0] - from[0], to[1] - from[1]];
    let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
    let pairs = a.windows(2).flat_map(|s| b.windows(2).map(move |t| (s, t)));
    pairs.filter_map(move |(s, t)| {
        let (along, other, gap) = (between(s[0], s[1]), between(t[0], t[1]), between(s[0], t[0]));
        let area = cross(along, other);
        let share = cross(gap, other) / area;
        let inside = (0.0..1.0).contains(&share) && (0.0..1.0).contains(&(cross(gap, along) / area));
        inside.then(|| [s[0][0] + share * along[0], s[0][1] + share * along[1]])
    })
}

/// Unpacks a gzip file; returns any other content unchanged.
pub fn unpack(bytes: &[u8]) -> Result<Cow<'_, [u8]>, ImportError> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(Cow::Borrowed(bytes));
    }
    let mut content = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes)
        .take(MAP_FILE_SIZE_LIMIT as u64 + 1)
        .read_to_end(&mut content)
        .map_err(|error| ImportError::Packed { problem: error.to_string() })?;
    if content.len() > MAP_FILE_SIZE_LIMIT {
        return Err(ImportError::TooLarge { bytes: content.len(), limit: MAP_FILE_SIZE_LIMIT });
    }
    Ok(Cow::Owned(content))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_compressed_file_is_its_content_and_a_broken_one_an_error() {
        let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        writer.write_all(b"speed,flow\n").unwrap();
        let packed = writer.finish().unwrap();
        assert_eq!(file_text(&packed).unwrap(), "speed,flow\n");
        assert!(matches!(unpack(&packed[..12]), Err(ImportError::Packed { .. })));
        assert_eq!(*unpack(b"plain").unwrap(), *b"plain");
    }
}
