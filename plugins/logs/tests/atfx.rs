//! ASAM ATFX under the names of a server of our own; values in the file and in a binary file next to it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::hostile::look;
use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::{LogError, LogFile, LogOptions};
use proptest::prelude::*;
use std::path::Path;

/// An element of the application model: its name, its base type, and its attributes with those of the base model.
fn element(name: &str, base: &str, attributes: &[(&str, &str, &str)]) -> String {
    let attributes: String = attributes
        .iter()
        .map(|(kind, name, base)| {
            let tag = if *kind == "relation" { "base_relation" } else { "base_attribute" };
            format!("<{kind}_attribute><name>{name}</name><{tag}>{base}</{tag}></{kind}_attribute>")
        })
        .collect();
    format!(
        "<application_element><name>{name}</name><basetype>{base}</basetype>{attributes}</application_element>"
    )
}

fn channel(id: usize, form: &str, independent: u8, values: &str, flags: &str) -> String {
    format!(
        "<Kanal><Nr>{id}</Nr><Name>K{id}</Name><Form>{form}</Form><Frei>{independent}</Frei><Werte>{values}</Werte>{flags}<Groesse>{id}</Groesse><Matrix>7</Matrix></Kanal>\
         <Groesse><Nr>{id}</Nr><Name>G{id}</Name><Einheit>{id}</Einheit></Groesse>"
    )
}

/// Three rows: a time by start and step, a pressure with an invalid value, raw temperatures, and a speed in blocks of a binary file.
fn atfx(binary: &str) -> String {
    let model = [
        element(
            "Matrix",
            "AoSubmatrix",
            &[("application", "Nr", "id"), ("application", "Zeilen", "number_of_rows")],
        ),
        element("Einheit", "AoUnit", &[("application", "Nr", "id"), ("application", "Name", "name")]),
        element(
            "Groesse",
            "AoMeasurementQuantity",
            &[("application", "Nr", "id"), ("application", "Name", "name"), ("relation", "Einheit", "unit")],
        ),
        element(
            "Kanal",
            "AoLocalColumn",
            &[
                ("application", "Nr", "id"),
                ("application", "Name", "name"),
                ("application", "Form", "sequence_representation"),
                ("application", "Frei", "independent"),
                ("application", "Werte", "values"),
                ("application", "Marken", "flags"),
                ("application", "Roh", "generation_parameters"),
                ("relation", "Groesse", "measurement_quantity"),
                ("relation", "Matrix", "submatrix"),
            ],
        ),
    ];
    let units = ["s", "kPa", "degC", "1/min"].iter().enumerate();
    let units: String =
        units.map(|(id, unit)| format!("<Einheit><Nr>{id}</Nr><Name>{unit}</Name></Einheit>")).collect();
    let component = "<component><identifier>B</identifier><datatype>ieeefloat4_beo</datatype><length>3</length><inioffset>2</inioffset>\
                     <blocksize>6</blocksize><valperblock>1</valperblock><valoffsets>2</valoffsets></component>";
    let channels = [
        channel(0, "implicit_linear", 1, "", "<Roh>0.5 2</Roh>"),
        channel(
            1,
            "explicit",
            0,
            "<A_FLOAT32>98.5 -1 231.9</A_FLOAT32>",
            "<Marken><A_INT16>15 6 15</A_INT16></Marken>",
        ),
        channel(
            2,
            "raw_linear",
            0,
            "<A_INT32>100 110 120</A_INT32>",
            "<Roh><A_FLOAT64>-30 0.5</A_FLOAT64></Roh>",
        ),
        channel(3, "explicit", 0, component, ""),
    ];
    format!(
        "<?xml version=\"1.0\"?>\n<atfx_file version=\"1.3\"><files><component><identifier>B</identifier><filename>{binary}</filename></component></files>\
         <application_model>{}</application_model><instance_data><Matrix><Nr>7</Nr><Zeilen>3</Zeilen></Matrix>{units}{}</instance_data></atfx_file>",
        model.concat(),
        channels.concat()
    )
}

fn open(path: &Path, text: &str) -> Result<Vec<(f64, Vec<f64>)>, LogError> {
    std::fs::write(path, text).unwrap();
    let (format, mut log) = LOG_FORMATS.open(&LogFile::from_path(path), &LogOptions::default())?;
    assert_eq!(format.name, "ATFX");
    let units: Vec<Option<&str>> = log.layout().columns.iter().map(|column| column.unit.as_deref()).collect();
    assert_eq!(units[..2], [Some("kPa"), Some("degC")]);
    let (mut rows, wanted) = (Vec::new(), (0..units.len()).collect::<Vec<usize>>());
    log.rows(&wanted, &mut |row| {
        rows.push((row.t_s, row.values.to_vec()));
        Ok(())
    })?;
    Ok(rows)
}

#[test]
fn values_in_the_file_and_next_to_it() {
    let folder = tempfile::tempdir().unwrap();
    // Two bytes before the first block, two before each value.
    let speeds =
        [60_000f32, 61_000.5, 62_000.0].map(|speed| [vec![9, 9], speed.to_be_bytes().to_vec()].concat());
    std::fs::write(folder.path().join("b.bin"), [vec![0, 0], speeds.concat()].concat()).unwrap();
    let rows = open(&folder.path().join("log.atfx"), &atfx("b.bin")).unwrap();
    let times: Vec<f64> = rows.iter().map(|(t_s, _)| *t_s).collect();
    assert_eq!(times, [0.5, 2.5, 4.5]);
    assert_eq!((&rows[0].1, &rows[2].1), (&vec![98.5, 20.0, 60_000.0], &vec![231.9, 30.0, 62_000.0]));
    // Flag 6 is neither valid nor defined.
    assert!(rows[1].1[0].is_nan() && rows[1].1[1..] == [25.0, 61_000.5]);
}

/// A missing binary file, and one elsewhere on the machine, leave their column out; the rest is a log.
#[test]
fn binary_files_elsewhere_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["missing.bin", "/etc/hostname", "../b.bin"] {
        let rows = open(&folder.path().join("log.atfx"), &atfx(name)).unwrap();
        assert_eq!((rows.len(), rows[0].1.len()), (3, 2), "{name}");
    }
    let huge = atfx("b.bin").replace("<Zeilen>3<", "<Zeilen>99999999999<");
    assert!(open(&folder.path().join("log.atfx"), &huge).is_err());
}

proptest! {
    /// Any damage gives a log or an error.
    #[test]
    fn damaged_ones_are_read_or_refused(at in prop::collection::vec((0..4000usize, any::<u8>()), 1..6), end in 0..4000usize) {
        let mut bytes = atfx("b.bin").into_bytes();
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
