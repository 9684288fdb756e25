//! Reads sheets of Excel workbooks.

use crate::table::sheet::grid::{Grid, GridRow, MAX_CELLS, MAX_ROWS, count_number_cells};
use crate::table::sheet::matrices::{points_of_matrices, quantity_of_title};
use crate::table::sheet::speed_heading::without_speed;
use mapper_core::ImportError;
use mapper_workbook::{XlsxLimits, check_xlsx};
use std::io::Cursor;

/// The cells of the named sheet, else of the first visible sheet with a table of numbers, else of a hidden one.
///
/// # Errors
/// [`ImportError::Workbook`] if it is not a workbook, unpacks to more than a map needs, or has no such sheet.
pub(crate) fn grid_of_workbook(bytes: &[u8], wanted: Option<&str>) -> Result<Grid, ImportError> {
    let mut sheets = sheets_of(bytes)?;
    let has_table = |sheet: &&mut Sheet| {
        sheet.rows.iter().filter(|row| count_number_cells(&row.cells, true) >= 3).count() >= 2
    };
    let grid = |sheet: &mut Sheet| Grid::of_rows(std::mem::take(&mut sheet.rows));
    let is_wanted = |sheet: &&mut Sheet| match wanted {
        Some(name) => sheet.name == name,
        None => !sheet.is_hidden,
    };
    // A sheet for each speed line, named after its speed.
    let speed_rpm = |sheet: &Sheet| {
        let (rest, speed_rpm) = without_speed(&Grid::of_rows(Vec::new()), &sheet.name)?;
        (rest.is_empty() || sheet.name.to_lowercase().contains("rpm")).then_some(speed_rpm)
    };
    let visible = sheets.iter_mut().filter(|sheet| !sheet.is_hidden).filter(has_table);
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
    if let Some(sheet) = sheets.iter_mut().filter(is_wanted).find(has_table) {
        return Ok(grid(sheet));
    }
    // Hidden sheets usually have obsolete data: one counts only if it is named, or has the only table.
    let mut hidden: Vec<&mut Sheet> =
        sheets.iter_mut().filter(|sheet| sheet.is_hidden).filter(has_table).collect();
    if let (None, [only]) = (wanted, hidden.as_mut_slice()) {
        return Ok(grid(only));
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

/// Maximum number of cells between the first and the last of each row of a sheet, empty ones included: 100 000 points with 40 columns.
const MAX_SHEET_CELLS: usize = 40 * MAX_ROWS;

/// All sheets of a workbook.
fn sheets_of(bytes: &[u8]) -> Result<Vec<Sheet>, ImportError> {
    let failed = |problem: String| ImportError::Workbook { problem };
    let mut sheets = Vec::new();
    let mut add = |name: String, is_hidden: bool, cells: Vec<PositionedCell>| {
        let rows = rows_of_cells(cells).map_err(|why| failed(format!("sheet `{name}` {why}")))?;
        sheets.push(Sheet { name, is_hidden, rows });
        Ok::<(), ImportError>(())
    };
    // Limits the memory: many cells may share one long text.
    let mut left = MAX_UNPACKED_BYTES as usize;
    let mut trimmed = |text: &str| {
        let text = text.trim();
        left = left.checked_sub(text.len()).ok_or_else(|| failed(too_large()))?;
        Ok::<String, ImportError>(text.to_owned())
    };
    if bytes.starts_with(&mapper_workbook::MAGIC) {
        for sheet in mapper_workbook::read_xls(Cursor::new(bytes)).map_err(failed)? {
            let mut cells = Vec::new();
            for (row, column, cell) in sheet.cells {
                let text = match cell {
                    mapper_workbook::Cell::Number(value) | mapper_workbook::Cell::Days(value) => {
                        trimmed(&value.to_string())?
                    }
                    mapper_workbook::Cell::Text(text) => trimmed(&text)?,
                };
                cells.push((u32::from(row), usize::from(column), text));
            }
            add(sheet.name, sheet.is_hidden, cells)?;
        }
        return Ok(sheets);
    }
    let limits = XlsxLimits { unpacked_bytes: MAX_UNPACKED_BYTES, memory_bytes: MAX_UNPACKED_BYTES };
    check_xlsx(Cursor::new(bytes), limits).map_err(failed)?;
    let book = calamine::Reader::new(Cursor::new(bytes));
    let mut book: calamine::Xlsx<_> = book.map_err(|error: calamine::XlsxError| failed(error.to_string()))?;
    for sheet in calamine::Reader::sheets_metadata(&book).to_vec() {
        // `worksheet_range` would allocate the rectangle around all cells. Charts have no cells.
        let Ok(mut reader) = book.worksheet_cells_reader(&sheet.name) else { continue };
        let mut cells = Vec::new();
        while let Some(cell) = reader.next_cell().map_err(|error| failed(error.to_string()))? {
            let (row, column) = cell.get_position();
            let text = match cell.get_value() {
                calamine::DataRef::SharedString(text) => trimmed(text)?,
                value => trimmed(&calamine::Data::from(value.clone()).to_string())?,
            };
            cells.push((row, column as usize, text));
        }
        add(sheet.name, sheet.visible != calamine::SheetVisible::Visible, cells)?;
    }
    Ok(sheets)
}

/// A cell with its row and column from 0.
type PositionedCell = (u32, usize, String);

/// The rows of cells that are not blank, from the first column with a cell.
fn rows_of_cells(mut cells: Vec<PositionedCell>) -> Result<Vec<GridRow>, String> {
    cells.sort_by_key(|(row, column, _)| (*row, *column));
    let first = cells.iter().map(|(_, column, _)| *column).min().unwrap_or_default();
    let mut rows = Vec::new();
    let mut left = MAX_SHEET_CELLS;
    for row in cells.chunk_by(|(row, ..), (next, ..)| row == next) {
        let mut texts = Vec::new();
        for (_, column, text) in
            row.iter().filter(|(_, column, text)| !text.is_empty() && *column < MAX_CELLS)
        {
            texts.resize(column - first, String::new());
            texts.push(text.clone());
        }
        let too_many = || format!("has more than {MAX_SHEET_CELLS} cells; no map needs that");
        left = left.checked_sub(texts.len()).ok_or_else(too_many)?;
        let at = row.first().map_or(0, |(row, ..)| *row as usize + 1);
        let row = GridRow { at, cells: texts, is_comment: false };
        if rows.len() < 2 * MAX_ROWS && row.cells.iter().any(|cell| cell.contains(char::is_alphanumeric)) {
            rows.push(row);
        }
    }
    Ok(rows)
}

/// Maximum unpacked size of a workbook, bytes: 100 000 points with 20 columns of 30 bytes.
const MAX_UNPACKED_BYTES: u64 = 64 << 20;

fn too_large() -> String {
    format!("it unpacks to more than {} MB; no map needs that", MAX_UNPACKED_BYTES >> 20)
}
