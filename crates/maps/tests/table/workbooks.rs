//! Workbooks with several sheets, made here part by part.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{CompressorMap, ImportError, MapDescription, ReferenceState};
use mapper_maps::table::{file_text, read_any_text, read_workbook};
use std::io::{Cursor, Write};

/// Name, state (`visible`, `hidden`) and rows of a sheet.
pub type Sheet<'a> = (&'a str, &'a str, &'a [&'a [&'a str]]);

pub fn workbook(sheets: &[Sheet<'_>]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let mut part = |name: &str, text: &str| {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    };
    let main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
    let office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let package = "http://schemas.openxmlformats.org/package/2006";
    let (mut list, mut relations, mut types) = (String::new(), String::new(), String::new());
    for (index, (name, state, rows)) in sheets.iter().enumerate() {
        let number = index + 1;
        list += &format!(r#"<sheet name="{name}" sheetId="{number}" state="{state}" r:id="rId{number}"/>"#);
        relations += &format!(
            r#"<Relationship Id="rId{number}" Type="{office}/worksheet" Target="worksheets/sheet{number}.xml"/>"#
        );
        types += &format!(
            r#"<Override PartName="/xl/worksheets/sheet{number}.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>"#
        );
        let mut data = String::new();
        for (row, cells) in rows.iter().enumerate() {
            if let [row] = cells
                && row.starts_with('<')
            {
                data += row;
                continue;
            }
            data += &format!(r#"<row r="{}">"#, row + 1);
            for (column, cell) in cells.iter().enumerate() {
                let place = format!("{}{}", char::from(b'A' + u8::try_from(column).unwrap()), row + 1);
                data += &match cell.parse::<f64>() {
                    Ok(_) => format!(r#"<c r="{place}"><v>{cell}</v></c>"#),
                    Err(_) => format!(r#"<c r="{place}" t="inlineStr"><is><t>{cell}</t></is></c>"#),
                };
            }
            data += "</row>";
        }
        part(
            &format!("xl/worksheets/sheet{number}.xml"),
            &format!(r#"<worksheet xmlns="{main}"><sheetData>{data}</sheetData></worksheet>"#),
        );
    }
    part(
        "[Content_Types].xml",
        &format!(
            r#"<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Override PartName="/xl/workbook.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>{types}</Types>"#
        ),
    );
    part(
        "_rels/.rels",
        &format!(
            r#"<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>"#
        ),
    );
    part(
        "xl/workbook.xml",
        &format!(r#"<workbook xmlns="{main}" xmlns:r="{office}"><sheets>{list}</sheets></workbook>"#),
    );
    part(
        "xl/_rels/workbook.xml.rels",
        &format!(r#"<Relationships xmlns="{package}/relationships">{relations}</Relationships>"#),
    );
    zip.finish().unwrap().into_inner()
}

const OLD: &[&[&str]] = &[
    &["speed [rpm]", "flow [kg/s]", "PR", "eta"],
    &["60000", "0.05", "1.3", "0.6"],
    &["60000", "0.04", "1.4", "0.62"],
];
/// With a column of text, and a comma in it.
const NEW: &[&[&str]] = &[
    &["speed [rpm]", "flow [kg/s]", "PR", "eta", "remark"],
    &["90000", "0.07", "1.8", "0.7", "good, steady"],
    &["90000", "0.06", "1.9", "0.71", "good"],
];

fn speed(bytes: &[u8], sheet: Option<&str>) -> Result<f64, ImportError> {
    let given = MapDescription {
        reference: Some(ReferenceState::SAE),
        sheet: sheet.map(str::to_owned),
        ..MapDescription::default()
    };
    Ok(read_workbook(bytes, &given)?.map.lines[0].speed_corrected_rpm)
}

#[test]
fn a_hidden_sheet_counts_if_it_is_named_or_the_only_one() {
    let book =
        workbook(&[("Old", "hidden", OLD), ("Title", "visible", &[&["a turbo"]]), ("New", "visible", NEW)]);
    assert_eq!(speed(&book, None).unwrap(), 90e3);
    assert_eq!(speed(&book, Some("Old")).unwrap(), 60e3);
    assert!(matches!(speed(&book, Some("Other")), Err(ImportError::Workbook { .. })));
    let hidden = workbook(&[("Old", "hidden", OLD)]);
    assert_eq!(speed(&hidden, None).unwrap(), speed(&hidden, Some("Old")).unwrap(), "the only table");
    let both = workbook(&[("Old", "hidden", OLD), ("Older", "hidden", NEW)]);
    assert!(matches!(speed(&both, None), Err(ImportError::Workbook { .. })));
}

/// A sheet for each speed line, named after its speed.
#[test]
fn sheets_of_speed_lines_are_one_map() {
    let line: &[&[&str]] =
        &[&["flow", "PR", "eta"], &["kg/s", "-", "-"], &["0.07", "1.4", "0.7"], &["0.06", "1.5", "0.71"]];
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    for names in [["60 krpm", "90000 rpm"], ["60000", "90000"], ["N=60k", "N=90k"]] {
        let book = workbook(&names.map(|name| (name, "visible", line)));
        let map = read_workbook(&book, &given).unwrap().map;
        let lines = map.lines.iter().map(|line| (line.speed_corrected_rpm, line.points.len()));
        assert_eq!(lines.collect::<Vec<_>>(), [(60e3, 2), (90e3, 2)], "{names:?}");
    }
}

/// The rectangle around the cells of a sheet has 17 thousand million cells, if one of them is in its last corner.
#[test]
fn a_stray_cell_takes_its_own_room_alone() {
    let far: &[&str] = &[r#"<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>"#];
    let rows = [NEW, &[far]].concat();
    let stray = workbook(&[("New", "visible", &rows)]);
    assert_eq!(speed(&stray, None).unwrap(), 90e3);
}

/// Campaigns keep the text of their map: that of a workbook is its sheet.
#[test]
fn the_text_of_a_workbook_is_the_same_map() {
    let book = workbook(&[("New", "visible", NEW)]);
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    let text = file_text(&book).unwrap();
    // As JSON: a map has numbers that are not known, and those are equal to none.
    let json = |map: CompressorMap| serde_json::to_string(&map).unwrap();
    let of_text = read_any_text(&text, &given).unwrap().map;
    assert_eq!(json(of_text), json(read_workbook(&book, &given).unwrap().map));
}
