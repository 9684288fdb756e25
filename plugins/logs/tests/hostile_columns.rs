//! Damaged and hostile TDMS, Parquet and Arrow: no panic, no hang, no allocation larger than the file justifies.
#![cfg(all(feature = "parquet", feature = "tdms"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray};
use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::{LogFile, LogOptions, survey};
use proptest::prelude::*;
use std::io::Cursor;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use tedium::{ChannelPath, DataLayout, PropertyPath, PropertyValue, TdmsFile};

/// Opens and reads all of it.
fn look(bytes: &[u8]) -> Option<u64> {
    let file = LogFile::from_bytes(Path::new("log"), bytes);
    let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).ok()?;
    survey(log.as_mut()).ok().map(|found| found.groups[0].rows)
}

const ROWS: usize = 300;

fn values(factor: f64) -> Vec<f64> {
    (0..ROWS).map(|row| factor * row as f64).collect()
}

fn tdms() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut file = TdmsFile::new(&mut bytes).unwrap();
    let mut writer = file.writer().unwrap();
    let channels = ["time", "T2"].map(|name| ChannelPath::new("stand", name));
    let both: Vec<f64> = values(0.1).into_iter().zip(values(1.0)).flat_map(|(t, v)| [t, v]).collect();
    writer.write_channels(&channels, &both, DataLayout::Interleaved).unwrap();
    let later: Vec<f64> = values(0.1).into_iter().map(|t| t + 30.0).chain(values(1.0)).collect();
    writer.write_channels(&channels, &later, DataLayout::Contigious).unwrap();
    let unit = PropertyValue::String("degC".to_owned());
    writer.write_properties(&PropertyPath::channel("stand", "T2"), &[("unit_string", unit)]).unwrap();
    drop(writer);
    drop(file);
    bytes.into_inner()
}

fn batch() -> RecordBatch {
    let texts = StringArray::from_iter_values(
        (0..ROWS).map(|row| format!("2026-11-22 09:{:02}:{:02}", row / 60, row % 60)),
    );
    let column = |factor: f64| Arc::new(Float64Array::from(values(factor))) as ArrayRef;
    RecordBatch::try_from_iter([
        ("date", Arc::new(texts) as ArrayRef),
        ("n [rpm]", column(1e3)),
        ("T2 [degC]", column(0.1)),
    ])
    .unwrap()
}

fn parquet() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = ::parquet::arrow::ArrowWriter::try_new(&mut bytes, batch().schema(), None).unwrap();
    writer.write(&batch()).unwrap();
    writer.close().unwrap();
    bytes
}

fn arrow_file() -> Vec<u8> {
    let mut writer = arrow_ipc::writer::FileWriter::try_new(Vec::new(), &batch().schema()).unwrap();
    writer.write(&batch()).unwrap();
    writer.into_inner().unwrap()
}

fn arrow_stream() -> Vec<u8> {
    let mut writer = arrow_ipc::writer::StreamWriter::try_new(Vec::new(), &batch().schema()).unwrap();
    writer.write(&batch()).unwrap();
    writer.into_inner().unwrap()
}

fn files() -> &'static [Vec<u8>; 4] {
    static FILES: OnceLock<[Vec<u8>; 4]> = OnceLock::new();
    FILES.get_or_init(|| [tdms(), parquet(), arrow_file(), arrow_stream()])
}

#[test]
fn the_files_themselves_are_read() {
    for (bytes, name) in files().iter().zip(["TDMS", "Parquet", "Arrow", "Arrow"]) {
        let file = LogFile::from_bytes(Path::new("log"), bytes);
        let (format, log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
        assert_eq!(format.name, name);
        let t2 = log.layout().columns.iter().find(|column| column.name == "T2").unwrap();
        assert_eq!(t2.unit.as_deref(), Some("degC"), "{name}");
        assert!(look(bytes).unwrap() >= ROWS as u64, "{name}");
    }
}

#[test]
fn every_truncation_ends() {
    for bytes in files() {
        (0..bytes.len()).step_by(bytes.len() / 200 + 1).for_each(|length| {
            look(&bytes[..length]);
        });
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

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
