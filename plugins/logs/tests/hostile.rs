//! Damaged, foreign and hostile logs: no panic, no hang, no allocation larger than the file justifies.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::proposal::{channel_map_text, propose};
use mapper_recording::logs::{LogFile, LogFinding, LogOptions, survey};
use proptest::prelude::*;
use std::io::Write;
use std::path::Path;
use std::sync::OnceLock;

/// Does everything that `mapper log inspect` does with a file.
pub(crate) fn look(bytes: &[u8]) {
    let file = LogFile::from_bytes(Path::new("log"), bytes);
    let Ok((_, mut log)) = LOG_FORMATS.open(&file, &LogOptions::default()) else { return };
    let Ok(found) = survey(log.as_mut()) else { return };
    let layout = log.layout().clone();
    drop(channel_map_text("log", &layout, &propose(&layout, &found, None), &[]));
}

fn csv() -> Vec<u8> {
    let mut text =
        String::from("Pr\u{fc}fstand 7\nDatum;Uhrzeit;t [s];n_TC [U/min];p1 [mbar rel];\"T2 [°C]\"\n");
    for row in 0..60 {
        text.push_str(&format!(
            "22.11.2026;14:03:{:02};{row},5;{};-1,2;\"2{row},25\"\n",
            row % 60,
            60_000 + row
        ));
    }
    text.into_bytes()
}

fn mdf4() -> Vec<u8> {
    let mut writer = falcon_mdf::Mf4Writer::new();
    let times: Vec<f64> = (0..50).map(|row| f64::from(row) / 10.0).collect();
    let group = writer.add_group(&times).unwrap();
    group.add_channel("n_TC", "rpm", &times).unwrap();
    group.add_channel("T2", "degC", &times).unwrap();
    let mut bytes = Vec::new();
    writer.write(&mut bytes).unwrap();
    bytes
}

/// An integer of an MDF file.
fn number(bytes: &[u8], at: usize) -> usize {
    usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap()
}

/// Gives a channel of an MDF file a conversion by this formula: blocks `CC` and `TX` at the end, and the link to them.
fn with_formula(mut bytes: Vec<u8>, name: &str, formula: &str) -> Vec<u8> {
    let block = |kind: &[u8], links: &[usize], data: &[u8]| {
        let mut block = [kind, &[0; 4]].concat();
        block.extend(u64::try_from(24 + 8 * links.len() + data.len()).unwrap().to_le_bytes());
        block.extend(u64::try_from(links.len()).unwrap().to_le_bytes());
        links.iter().for_each(|link| block.extend(u64::try_from(*link).unwrap().to_le_bytes()));
        [block, data.to_vec()].concat()
    };
    let channel = (0..bytes.len() - 48)
        .filter(|at| bytes[*at..].starts_with(b"##CN"))
        .find(|at| bytes[number(&bytes, at + 24 + 16) + 24..].starts_with(name.as_bytes()))
        .unwrap();
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let text = bytes.len();
    bytes.extend(block(b"##TX", &[], &[formula.as_bytes(), &[0; 8]].concat()));
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let conversion = bytes.len();
    // Kind 3, one reference, no values, no range.
    let data = [&[3, 0, 0, 0, 1, 0, 0, 0][..], &[0; 16]].concat();
    bytes.extend(block(b"##CC", &[0, 0, 0, 0, text], &data));
    bytes[channel + 24 + 32..channel + 24 + 40]
        .copy_from_slice(&u64::try_from(conversion).unwrap().to_le_bytes());
    bytes
}

/// A minimal workbook, stored without compression so that a flipped byte reaches the XML.
fn xlsx() -> Vec<u8> {
    workbook(&parts(HEADER, SHARED_STRINGS))
}

/// The cells of the first row: one holds its text, the other refers to a shared one.
const HEADER: &str =
    "<c r=\"A1\" t=\"inlineStr\"><is><t>time [s]</t></is></c><c r=\"B1\" t=\"s\"><v>0</v></c>";

const SHARED_STRINGS: &str = "<sst count=\"1\" uniqueCount=\"1\"><si><t>T2 [degC]</t></si></sst>";

fn parts(header: &str, shared_strings: &str) -> Vec<(String, String)> {
    let mut rows = format!("<row r=\"1\">{header}</row>");
    for row in 2..40 {
        rows.push_str(&format!(
            "<row r=\"{row}\"><c r=\"A{row}\"><v>{row}</v></c><c r=\"B{row}\"><v>{row}.5</v></c></row>"
        ));
    }
    let head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>";
    let main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
    let relations = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let package = "http://schemas.openxmlformats.org/package/2006";
    [
        ("[Content_Types].xml", format!("{head}<Types xmlns=\"{package}/content-types\"/>")),
        (
            "_rels/.rels",
            format!(
                "{head}<Relationships xmlns=\"{package}/relationships\"><Relationship Id=\"r1\" Type=\"{relations}/officeDocument\" Target=\"xl/workbook.xml\"/></Relationships>"
            ),
        ),
        (
            "xl/workbook.xml",
            format!(
                "{head}<workbook xmlns=\"{main}\" xmlns:r=\"{relations}\"><sheets><sheet name=\"Log\" sheetId=\"1\" r:id=\"r1\"/></sheets></workbook>"
            ),
        ),
        (
            "xl/_rels/workbook.xml.rels",
            format!(
                "{head}<Relationships xmlns=\"{package}/relationships\"><Relationship Id=\"r1\" Type=\"{relations}/worksheet\" Target=\"worksheets/sheet1.xml\"/></Relationships>"
            ),
        ),
        ("xl/sharedStrings.xml", format!("{head}{shared_strings}")),
        (
            "xl/worksheets/sheet1.xml",
            format!(
                "{head}<worksheet xmlns=\"{main}\"><dimension ref=\"A1:B39\"/><sheetData>{rows}</sheetData></worksheet>"
            ),
        ),
    ]
    .map(|(name, text)| (name.to_owned(), text))
    .to_vec()
}

fn workbook(parts: &[(String, String)]) -> Vec<u8> {
    packed_workbook(parts, zip::CompressionMethod::Stored)
}

fn packed_workbook(parts: &[(String, String)], method: zip::CompressionMethod) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut archive = zip::ZipWriter::new(&mut bytes);
    for (name, text) in parts {
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        archive.start_file(name.as_str(), options).unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap();
    bytes.into_inner()
}

fn files() -> &'static [Vec<u8>; 3] {
    static FILES: OnceLock<[Vec<u8>; 3]> = OnceLock::new();
    FILES.get_or_init(|| [csv(), mdf4(), xlsx()])
}

/// An element of MATLAB data of level 5: type, size, data.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let size = u32::try_from(data.len()).unwrap();
    let mut element = [kind.to_le_bytes(), size.to_le_bytes()].concat();
    element.extend(data);
    element.resize(element.len().next_multiple_of(8), 0);
    element
}

/// Small files whose content would fill the memory: each is refused, or loses the column.
#[test]
fn what_a_small_file_unpacks_to_is_limited() {
    let zeros = vec![0; 65 << 20];
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(&zeros).unwrap();
    let gz = packed.finish().unwrap();
    // Bytes, which become numbers of eight bytes each.
    let count = 9 << 20;
    let (flags, size) = (element(6, &[9, 0, 0, 0, 0, 0, 0, 0]), element(5, &[0, 0, 0x90, 0, 1, 0, 0, 0]));
    let array = [flags, size, element(1, b"a"), element(2, &zeros[..count])].concat();
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(&element(14, &array)).unwrap();
    let mut mat = b"MATLAB 5.0 MAT-file".to_vec();
    mat.resize(124, 0);
    mat.extend(b"\0\x01IM");
    mat.extend(element(15, &packed.finish().unwrap()));
    let mut sheets = parts(HEADER, SHARED_STRINGS);
    sheets.last_mut().unwrap().1 =
        format!("<worksheet><sheetData>{}</sheetData></worksheet>", "<row/>".repeat((1 << 20) + 1));
    for (bytes, named) in [(gz, "64 MiB"), (mat, "unpacks"), (workbook(&sheets), "rows")] {
        let file = LogFile::from_bytes(Path::new("log"), &bytes);
        let error = LOG_FORMATS.open(&file, &LogOptions::default()).err().expect(named).to_string();
        assert!(error.contains(named), "{error}");
    }
}

#[test]
fn the_files_themselves_are_read() {
    for (bytes, name) in files().iter().zip(["CSV", "MDF4", "Excel"]) {
        let file = LogFile::from_bytes(Path::new("log"), bytes);
        let (format, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
        assert_eq!(format.name, name);
        let found = survey(log.as_mut()).unwrap();
        assert!(
            found.groups[0].rows >= 38 && found.columns.iter().any(|column| column.count >= 38),
            "{name}: {found:?}"
        );
    }
}

#[test]
fn every_truncation_ends() {
    for bytes in files() {
        (0..bytes.len()).step_by(bytes.len() / 60 + 1).for_each(|length| look(&bytes[..length]));
    }
}

/// Why a file is refused.
fn refusal(bytes: &[u8]) -> String {
    let file = LogFile::from_bytes(Path::new("log"), bytes);
    LOG_FORMATS.open(&file, &LogOptions::default()).err().expect("refused").to_string()
}

/// A conversion rule that calls its reader at each level: the process would end without a stack. The channel is left out, the others are read.
#[test]
fn a_formula_of_a_hundred_thousand_levels_costs_its_channel_alone() {
    let plain = mdf4();
    let deep = |open: &str, close: &str| format!("{}X{}", open.repeat(100_000), close.repeat(100_000));
    for formula in [deep("(", ")"), deep("-", ""), deep("abs(", ")"), deep("X+", ""), deep("2^", "")] {
        let bytes = with_formula(plain.clone(), "T2", &formula);
        let file = LogFile::from_bytes(Path::new("log"), &bytes);
        let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
        let names: Vec<String> = log.layout().columns.iter().map(|column| column.name.clone()).collect();
        assert_eq!(names, ["n_TC"]);
        assert_eq!(survey(log.as_mut()).unwrap().columns[0].count, 50);
    }
}

/// A formula of a sensor is applied: the deep ones above are what fails, not the conversion of the test.
#[test]
fn a_usual_formula_is_applied() {
    let bytes = with_formula(mdf4(), "T2", "((2*X+1)*X)^2");
    let file = LogFile::from_bytes(Path::new("log"), &bytes);
    let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    let found = survey(log.as_mut()).unwrap();
    // 4.9 s are the last sample.
    assert!(
        (found.columns[1].max - ((2.0 * 4.9 + 1.0) * 4.9f64).powi(2)).abs() < 1e-9,
        "{:?}",
        found.columns
    );
}

/// Few bytes that state an unpacked block of a gigabyte, or unpack to a workbook of gigabytes.
#[test]
fn bombs_are_refused_before_they_unpack() {
    let mut writer = falcon_mdf::Mf4Writer::new();
    writer.set_compression(true);
    let times: Vec<f64> = (0..5000).map(|row| f64::from(row) / 10.0).collect();
    writer.add_group(&times).unwrap().add_channel("T2", "K", &times).unwrap();
    let mut packed = Vec::new();
    writer.write(&mut packed).unwrap();
    let block = (0..packed.len()).find(|at| packed[*at..].starts_with(b"##DZ")).unwrap();
    let read = |bytes: &[u8]| -> Result<(), mapper_recording::logs::LogError> {
        let file = LogFile::from_bytes(Path::new("log"), bytes);
        survey(LOG_FORMATS.open(&file, &LogOptions::default())?.1.as_mut()).map(drop)
    };
    read(&packed).unwrap();
    let mut bomb = packed.clone();
    bomb[block + 32..block + 40].copy_from_slice(&(1u64 << 30).to_le_bytes());
    assert!(read(&bomb).unwrap_err().to_string().contains("1024 MiB"));
    // Zeros that unpack to 1.1 GiB: one MiB of them, packed a thousandfold.
    let mut bytes = std::io::Cursor::new(xlsx());
    let mut archive = zip::ZipWriter::new_append(&mut bytes).unwrap();
    for part in 0..9 {
        archive.start_file(format!("xl/media/{part}.bin"), zip::write::SimpleFileOptions::default()).unwrap();
        (0..127).for_each(|_| archive.write_all(&[0; 1 << 20]).unwrap());
    }
    archive.finish().unwrap();
    let bytes = bytes.into_inner();
    assert!(bytes.len() < 2 << 20, "{}", bytes.len());
    assert!(read(&bytes).unwrap_err().to_string().contains("1024 MiB"));
}

#[test]
#[cfg(unix)]
fn a_pipe_in_the_place_of_a_log_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("log.csv");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    for path in [pipe.as_path(), Path::new("/dev/zero"), folder.path()] {
        let error = LOG_FORMATS.open(&LogFile::from_path(path), &LogOptions::default()).err().unwrap();
        assert!(matches!(error, mapper_recording::logs::LogError::Read { .. }), "{error}");
    }
}

#[test]
fn a_workbook_that_claims_more_strings_than_it_has_room_for_is_refused() {
    for count in ["18446744073709551615", "4000000000", "-1"] {
        let strings = SHARED_STRINGS.replace("uniqueCount=\"1\"", &format!("uniqueCount=\"{count}\""));
        let error = refusal(&workbook(&parts(HEADER, &strings)));
        assert!(error.contains("sharedStrings.xml claims"), "{error}");
    }
}

/// Each element takes memory although it has few bytes in the file.
#[test]
fn a_workbook_of_many_small_elements_is_refused() {
    let replaced = |part: &str, text: &str, by: String| {
        let mut parts = parts(HEADER, SHARED_STRINGS);
        let found = parts.iter_mut().find(|(name, _)| name.ends_with(part)).unwrap();
        assert!(found.1.contains(text), "{part}: {}", found.1);
        found.1 = found.1.replace(text, &by);
        refusal(&packed_workbook(&parts, zip::CompressionMethod::Deflated))
    };
    let names = "<definedName name=\"a\">b</definedName>".repeat(300_000);
    for (part, text, by) in [
        ("sharedStrings.xml", "</sst>", "<si/>".repeat(1_200_000) + "</sst>"),
        ("xl/workbook.xml", "<sheets>", format!("<definedNames>{names}</definedNames><sheets>")),
    ] {
        let error = replaced(part, text, by);
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[test]
fn a_long_shared_string_is_cut_where_it_is_used() {
    let strings = SHARED_STRINGS.replace("T2 [degC]", &format!("T2 [degC] {}", "long ".repeat(1 << 18)));
    let bytes = workbook(&parts(HEADER, &strings));
    let file = LogFile::from_bytes(Path::new("log"), &bytes);
    let (_, log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    let header = &log.layout().columns[0].header;
    assert!(header.starts_with("T2") && header.len() <= 1024, "{} bytes", header.len());
}

#[test]
fn a_cell_that_never_ends_is_refused() {
    let whole = "x".repeat(3 << 20);
    let pieces = "<r><t>x</t></r>".repeat(1 << 18);
    for text in [format!("<t>{whole}</t>"), pieces, format!("<t a=\"{whole}\">x</t>")] {
        let header = HEADER.replace("<t>time [s]</t>", &text);
        let error = refusal(&workbook(&parts(&header, SHARED_STRINGS)));
        assert!(error.contains("sheet1.xml has a cell"), "{error}");
    }
    let deep = HEADER.replace("<is>", &format!("<is>{}", "<t>".repeat(1000)));
    let error = refusal(&workbook(&parts(&deep, SHARED_STRINGS)));
    assert!(error.contains("within each other"), "{error}");
}

#[test]
fn parts_that_share_their_bytes_and_parts_without_end_are_refused() {
    let mut many = parts(HEADER, SHARED_STRINGS);
    many.extend((0..10_000).map(|part| (format!("xl/media/{part}.xml"), String::new())));
    assert!(refusal(&workbook(&many)).contains("at most 10000 are read"));
    let mut bytes = std::io::Cursor::new(xlsx());
    let mut archive = zip::ZipWriter::new_append(&mut bytes).unwrap();
    archive.shallow_copy_file("xl/worksheets/sheet1.xml", "xl/worksheets/sheet2.xml").unwrap();
    archive.finish().unwrap();
    assert!(refusal(&bytes.into_inner()).contains("overlap"));
}

#[test]
fn a_quote_that_is_never_closed_does_not_swallow_the_file() {
    let mut text = String::from("t [s];T2 [degC]\n0;20\n1;21\n2;\"");
    (3..400_000).for_each(|row| text.push_str(&format!("{row};22\n")));
    let file = LogFile::from_bytes(Path::new("log"), text.as_bytes());
    let error = match LOG_FORMATS.open(&file, &LogOptions::default()) {
        Err(error) => error.to_string(),
        Ok((_, mut log)) => survey(log.as_mut()).unwrap_err().to_string(),
    };
    assert!(error.contains("quote"), "{error}");
}

#[test]
fn a_line_of_cells_alone_is_refused() {
    let many = ["time;".repeat(30_000), "1;".repeat(30_000), "2;".repeat(30_000)].join("\n");
    let file = LogFile::from_bytes(Path::new("log"), many.as_bytes());
    let error = LOG_FORMATS.open(&file, &LogOptions::default()).err().unwrap().to_string();
    assert!(error.contains("at most 10000"), "{error}");
    // Thousands of names, each a possible clock.
    look(["time;".repeat(9_000), "1;".repeat(9_000), "2;".repeat(9_000)].join("\n").as_bytes());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        look(&bytes);
    }

    #[test]
    fn no_text_panics(text in "[-+0-9.,;:/\t \n\"a-zA-Z\\[\\]%°ü]{0,400}") {
        look(text.as_bytes());
    }

    #[test]
    fn no_flipped_bytes_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        for bytes in files() {
            let mut bytes = bytes.clone();
            for (index, value) in &flips {
                let at = index.index(bytes.len());
                bytes[at] = *value;
            }
            look(&bytes);
        }
    }
}

/// A hidden sheet may hold an earlier state of the data: it is read only if it is named.
#[test]
fn a_hidden_sheet_is_read_only_if_it_is_named() {
    let mut with_hidden = parts(HEADER, SHARED_STRINGS);
    let sheet = with_hidden.iter().find(|(name, _)| name.ends_with("sheet1.xml")).unwrap().1.clone();
    with_hidden.push(("xl/worksheets/sheet2.xml".to_owned(), sheet.replace(".5</v>", ".25</v>")));
    for (name, text) in &mut with_hidden {
        if name.ends_with("workbook.xml.rels") {
            let second = text.split("<Relationship ").nth(1).unwrap().split("/>").next().unwrap();
            let second = second.replace("r1", "r2").replace("sheet1", "sheet2");
            *text = text.replace("</Relationships>", &format!("<Relationship {second}/></Relationships>"));
        } else if name == "xl/workbook.xml" {
            let second = "<sheet name=\"Old\" sheetId=\"2\" state=\"hidden\" r:id=\"r2\"/></sheets>";
            *text = text.replace("</sheets>", second);
        }
    }
    let file = LogFile::from_bytes(Path::new("log.xlsx"), &workbook(&with_hidden));
    let first = |options: &LogOptions| {
        let (_, mut log) = LOG_FORMATS.open(&file, options).unwrap();
        let (mut values, findings) = (Vec::new(), log.layout().findings.clone());
        log.rows(&[0], &mut |row| {
            values.push(row.values[0]);
            Ok(())
        })
        .unwrap();
        (values[0], values.len(), findings)
    };
    let (value, rows, findings) = first(&LogOptions::default());
    assert_eq!((value, rows), (2.5, 38));
    let hidden = |is_read: bool| LogFinding::HiddenSheets { sheets: vec!["Old".to_owned()], is_read };
    assert!(findings.contains(&hidden(false)), "{findings:?}");
    let (value, ..) = first(&LogOptions { sheet: Some("Old".to_owned()), ..LogOptions::default() });
    assert_eq!(value, 2.25);
    // If no visible sheet has a table, the hidden one is the log.
    let first_sheet = with_hidden.iter_mut().find(|(name, _)| name.ends_with("sheet1.xml")).unwrap();
    first_sheet.1 =
        first_sheet.1.split("<sheetData>").next().unwrap().to_owned() + "<sheetData/></worksheet>";
    let file = LogFile::from_bytes(Path::new("log.xlsx"), &workbook(&with_hidden));
    let (_, log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    assert!(log.layout().findings.contains(&hidden(true)));
}

/// MATLAB data of level 5: vectors in a structure, and by themselves.
fn mat() -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let mut bytes = [kind.to_le_bytes(), u32::try_from(data.len()).unwrap().to_le_bytes()].concat();
        bytes.extend_from_slice(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let matrix = |class: u8, size: [i32; 2], name: &str, rest: &[u8]| {
        let flags = [[class, 0, 0, 0], [0; 4]].concat();
        let size = size.map(i32::to_le_bytes).concat();
        element(
            14,
            &[element(6, &flags), element(5, &size), element(1, name.as_bytes()), rest.to_vec()].concat(),
        )
    };
    let vector = |name: &str, value: fn(i32) -> f64| {
        let values: Vec<u8> = (0..40).flat_map(|row| value(row).to_le_bytes()).collect();
        matrix(6, [40, 1], name, &element(9, &values))
    };
    // The length of a name stands in the tag.
    let length = [&0x0004_0005u32.to_le_bytes()[..], &8u32.to_le_bytes()].concat();
    let fields = [
        length,
        element(1, b"time\0\0\0\0n_TC_rpm"),
        vector("", f64::from),
        vector("", |row| 6e4 + f64::from(row)),
    ];
    let text = matrix(4, [1, 3], "note", &element(4, &[b'a', 0, b'b', 0, b'c', 0]));
    let mut bytes = b"MATLAB 5.0 MAT-file, made here".to_vec();
    bytes.resize(124, b' ');
    bytes.extend_from_slice(&[0, 1, b'I', b'M']);
    [bytes, text, matrix(2, [1, 1], "log", &fields.concat())].concat()
}

#[test]
fn matlab_data_are_read() {
    let file = LogFile::from_bytes(Path::new("log.mat"), &mat());
    let (format, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    let columns = &log.layout().columns;
    assert_eq!((format.name, columns.len(), columns[0].unit.as_deref()), ("MATLAB", 1, Some("rpm")));
    let mut rows = Vec::new();
    log.rows(&[0], &mut |row| {
        rows.push((row.t_s, row.values[0]));
        Ok(())
    })
    .unwrap();
    assert_eq!((rows.len(), rows[39]), (40, (39.0, 60_039.0)));
}

proptest! {
    /// Any damage to MATLAB data gives a log or an error.
    #[test]
    fn damaged_matlab_data_are_read_or_refused(at in prop::collection::vec((120..1200usize, any::<u8>()), 1..6), end in 0..1200usize) {
        let mut bytes = mat();
        for (at, value) in at {
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
        }
        look(&bytes);
        bytes.truncate(end);
        look(&bytes);
    }
}
