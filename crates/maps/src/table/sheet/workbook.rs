//! Reads sheets of Excel workbooks.

use crate::table::columns::quantity_name::end_in;
use crate::table::sheet::grid::{Grid, GridRow, MAX_ROWS, count_number_cells};
use crate::table::sheet::matrices::{points_of_matrices, quantity_of_title};
use crate::table::sheet::speed_heading::without_speed;
use mapper_core::ImportError;
use mapper_table::{Book, Value, XlsxLimits, decimal_sign_of_cells, parse_number};
use std::io::Cursor;

/// The cells of the named sheet, else of the first visible sheet with a table of numbers, else of a hidden one.
///
/// # Errors
/// [`ImportError::Workbook`] if it is not a workbook, unpacks to more than a map needs, or has no such sheet.
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

/// A sheet with its rows that are not blank.
struct Sheet {
    name: String,
    is_hidden: bool,
    rows: Vec<GridRow>,
}

/// Maximum number of cells of a sheet, empty ones between others included. Bound: 100 000 points with 40 columns.
const MAX_SHEET_CELLS: usize = 40 * MAX_ROWS;

/// All sheets of a workbook.
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
