//! Maps in workbooks of Excel. Read: the first visible sheet with a table of numbers. Written: the map, all values of its points, the
//! conditions, and the surge line.

use crate::csv::{columns, rows};
use crate::simulation_table::{efficiency_name, heading};
use mapper_core::{CompressorMap, ExportError, MapFormat};
use rust_xlsxwriter::{DocProperties, ExcelDateTime, Workbook, Worksheet, XlsxError};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "xlsx",
    extension: "xlsx",
    further_extensions: &["xlsm", "xls"],
    description: "workbook of Excel: the map, the points with their intervals and marks, the conditions, the surge line",
    write: Some(write),
    read: Some(mapper_maps::table::read_workbook),
    turbine: crate::turbine::WORKBOOK,
    ..MapFormat::NONE
};

/// Time of making in the file. Bound: the same map gives the same bytes.
const MADE_AT: (u16, u8, u8) = (2000, 1, 1);

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    workbook(map).map_err(ExportError::failed(FORMAT.name))
}

fn workbook(map: &CompressorMap) -> Result<Vec<u8>, XlsxError> {
    let mut book = Workbook::new();
    let (year, month, day) = MADE_AT;
    book.set_properties(
        &DocProperties::new()
            .set_title(&map.machine)
            .set_creation_datetime(&ExcelDateTime::from_ymd(year, month, day)?),
    );
    let notes = heading(map, "");
    let sheet = book.add_worksheet().set_name("Map")?;
    let mut at = 0;
    for note in notes.lines() {
        sheet.write_string(at, 0, note.trim())?;
        at += 1;
    }
    row(sheet, at, ["speed [rpm]", "flow [kg/s]", "pressure ratio", "efficiency"].map(str::to_owned))?;
    for (line, point) in rows(map) {
        at += 1;
        let numbers = [line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio];
        for (place, value) in (0..).zip(numbers.into_iter().chain(point.eta)) {
            sheet.write_number(at, place, value)?;
        }
    }
    let sheet = book.add_worksheet().set_name("Points")?;
    let columns = columns();
    row(sheet, 0, columns.map(|(name, _)| name.to_owned()))?;
    for (at, point) in (1..).zip(rows(map)) {
        row(sheet, at, columns.map(|(_, text)| text(&point)))?;
    }
    let sheet = book.add_worksheet().set_name("Conditions")?;
    let reference = map.reference;
    let conditions = [
        ("machine", map.machine.clone()),
        ("reference temperature [K]", reference.t_ref_k.to_string()),
        ("reference pressure [Pa]", reference.p_ref_pa.to_string()),
        ("method", map.method.to_string()),
        ("efficiency", efficiency_name(map.method).to_owned()),
        ("definition of efficiency", map.efficiency.map_or_else(String::new, |it| it.to_string())),
        ("gas", map.gas.clone().unwrap_or_default()),
    ];
    for (at, (name, value)) in (0..).zip(conditions) {
        row(sheet, at, [name.to_owned(), value])?;
    }
    if !map.surge.is_empty() {
        let sheet = book.add_worksheet().set_name("Surge line")?;
        row(sheet, 0, ["speed [rpm]", "flow [kg/s]", "pressure ratio"].map(str::to_owned))?;
        for (at, mark) in (1..).zip(&map.surge) {
            let numbers = [mark.speed_corrected_rpm, mark.flow_corrected_kg_s, mark.pressure_ratio];
            for (place, value) in (0..).zip(numbers) {
                sheet.write_number(at, place, value)?;
            }
        }
    }
    book.save_to_buffer()
}

/// Writes cells from the first column; texts of numbers become numbers.
fn row<const N: usize>(sheet: &mut Worksheet, at: u32, cells: [String; N]) -> Result<(), XlsxError> {
    for (place, cell) in (0..).zip(cells) {
        match cell.parse::<f64>() {
            Ok(number) if number.is_finite() => sheet.write_number(at, place, number)?,
            _ => sheet.write_string(at, place, cell)?,
        };
    }
    Ok(())
}
