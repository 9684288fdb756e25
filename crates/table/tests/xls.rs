//! Workbooks made here record by record, whole and broken.

#![allow(clippy::unwrap_used, missing_docs)]

use mapper_table::{Cell, read_xls};
use proptest::prelude::*;
use std::io::{Cursor, Write};

fn record(kind: u16, parts: &[&[u8]]) -> Vec<u8> {
    let data = parts.concat();
    [&kind.to_le_bytes()[..], &u16::try_from(data.len()).unwrap().to_le_bytes(), &data].concat()
}

fn cell(kind: u16, row: u16, column: u16, format: u16, value: &[u8]) -> Vec<u8> {
    record(kind, &[&row.to_le_bytes(), &column.to_le_bytes(), &format.to_le_bytes(), value])
}

/// A compound file with the stream of a workbook: its first part, and sheets with names and states.
fn book(globals: &[Vec<u8>], sheets: &[(&str, u8, Vec<u8>)]) -> Vec<u8> {
    let start = record(0x0809, &[&0x0600u16.to_le_bytes(), &5u16.to_le_bytes()]);
    let end = record(0x000A, &[]);
    let names: usize = sheets.iter().map(|(name, ..)| 12 + name.len()).sum();
    let mut stream = [start.clone(), globals.concat()].concat();
    let mut place = stream.len() + names + end.len();
    let bodies: Vec<Vec<u8>> =
        sheets.iter().map(|(_, _, cells)| [start.clone(), cells.clone(), end.clone()].concat()).collect();
    for ((name, state, _), body) in sheets.iter().zip(&bodies) {
        let at = u32::try_from(place).unwrap().to_le_bytes();
        let length = [u8::try_from(name.len()).unwrap(), 0];
        stream.extend(record(0x0085, &[&at, &[*state, 0], &length, name.as_bytes()]));
        place += body.len();
    }
    stream.extend(end);
    stream.extend(bodies.concat());
    let mut file = cfb::CompoundFile::create(Cursor::new(Vec::new())).unwrap();
    file.create_stream("/Workbook").unwrap().write_all(&stream).unwrap();
    file.into_inner().into_inner()
}

/// Texts of which the second is broken between two records, the rest with letters of two bytes.
fn strings() -> Vec<u8> {
    let shared = record(0x00FC, &[&[3, 0, 0, 0, 3, 0, 0, 0], &[1, 0, 0, b'N'], &[4, 0, 0, b'T', b'1']]);
    let more = record(0x003C, &[&[1, b' ', 0, 0xb0, 0], &[2, 0, 8, 1, 0, b'P', b'2', 9, 9, 9, 9]]);
    [shared, more].concat()
}

fn mixed() -> Vec<u8> {
    let format = record(0x041E, &[&164u16.to_le_bytes(), &[8, 0, 0], b"yyyy\\-mm"]);
    let plain = record(0x00E0, &[&[0, 0, 0, 0]]);
    let date = record(0x00E0, &[&[0, 0], &164u16.to_le_bytes()]);
    let cells = [
        cell(0x0203, 1, 0, 0, &101.325f64.to_le_bytes()),
        cell(0x0203, 1, 1, 1, &45_000.5f64.to_le_bytes()),
        // 12345 as an integer, over 100, and -1.5 as the upper half of a double.
        cell(0x027E, 1, 2, 0, &(12_345u32 << 2 | 3).to_le_bytes()),
        record(
            0x00BD,
            &[&[2, 0, 0, 0], &[0, 0], &0xBFF8_0000u32.to_le_bytes(), &[0, 0], &6u32.to_le_bytes(), &[1, 0]],
        ),
        cell(0x00FD, 0, 0, 0, &1u32.to_le_bytes()),
        cell(0x00FD, 0, 1, 0, &2u32.to_le_bytes()),
        cell(0x0006, 2, 2, 0, &[&3.25f64.to_le_bytes()[..], &[0; 8]].concat()),
        cell(0x0006, 2, 3, 0, &[0, 0, 0, 0, 0, 0, 0xff, 0xff, 0, 0, 0, 0, 0, 0, 0, 0]),
        record(0x0207, &[&[2, 0, 0], b"ok"]),
    ];
    book(&[format, plain, date, strings()], &[("Data", 0, cells.concat()), ("Old", 1, Vec::new())])
}

#[test]
fn every_kind_of_cell_has_its_value() {
    let sheets = read_xls(Cursor::new(mixed())).unwrap();
    let text = |text: &str| Cell::Text(text.into());
    let number = Cell::Number;
    assert_eq!(
        sheets.iter().map(|sheet| (&*sheet.name, sheet.is_hidden)).collect::<Vec<_>>(),
        [("Data", false), ("Old", true)]
    );
    let expected = [
        (0, 0, text("T1 °")),
        (0, 1, text("P2")),
        (1, 0, number(101.325)),
        (1, 1, Cell::Days(45_000.5)),
        (1, 2, number(123.45)),
        (2, 0, number(-1.5)),
        (2, 1, number(1.0)),
        (2, 2, number(3.25)),
        (2, 3, text("ok")),
    ];
    assert_eq!(sheets[0].cells, expected);
    assert!(sheets[1].cells.is_empty());
}

/// Two cells in opposite corners of 60 sheets: the rectangles between them would take 24 GB, the cells take 4 kB.
#[test]
fn distant_cells_take_their_own_room_alone() {
    let corners = [cell(0x0203, 0, 0, 0, &[0; 8]), cell(0x0203, 65_535, 255, 0, &[0; 8])].concat();
    let names: Vec<String> = (0..60).map(|sheet| format!("S{sheet:02}")).collect();
    let sheets: Vec<(&str, u8, Vec<u8>)> =
        names.iter().map(|name| (name.as_str(), 0, corners.clone())).collect();
    let read = read_xls(Cursor::new(book(&[], &sheets))).unwrap();
    assert_eq!(read.iter().map(|sheet| sheet.cells.len()).collect::<Vec<_>>(), [2; 60]);
}

#[test]
fn encrypted_ones_and_other_documents_are_refused() {
    let locked = book(&[record(0x002F, &[&[1, 0]])], &[]);
    assert!(read_xls(Cursor::new(locked)).unwrap_err().contains("password"));
    let other = cfb::CompoundFile::create(Cursor::new(Vec::new())).unwrap().into_inner();
    assert!(read_xls(other).unwrap_err().contains("no workbook"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// No byte may make the reader panic, hang, or find more cells than the file has bytes.
    #[test]
    fn a_changed_byte_and_a_cut_do_no_harm(at in 0usize..8192, to: u8, end in 0usize..8192) {
        let mut bytes = mixed();
        let at = at % bytes.len();
        bytes[at] = to;
        bytes.truncate(bytes.len() - end.saturating_sub(4096) % bytes.len());
        let count = read_xls(Cursor::new(&bytes)).map_or(0, |sheets| sheets.iter().map(|sheet| sheet.cells.len()).sum());
        prop_assert!(count < bytes.len());
    }
}
