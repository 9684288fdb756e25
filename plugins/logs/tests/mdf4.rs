//! Options for an MDF 4 file, and channels with equal names.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::{LogFile, LogFinding, LogOptions, Row};
use std::path::Path;

fn file() -> LogFile {
    let mut writer = falcon_mdf::Mf4Writer::new();
    let group = writer.add_group(&[0.0, 10.0, 20.0]).unwrap();
    group.add_channel("n_TC", "rpm", &[1e5, -9999.0, 1.1e5]).unwrap();
    group.add_channel("n_TC", "rpm", &[2e5, 2e5, 2e5]).unwrap();
    let path = std::env::temp_dir().join(format!(
        "mapper-mdf4-{}-{:?}.mf4",
        std::process::id(),
        std::thread::current().id()
    ));
    writer.write_to_file(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    LogFile::from_bytes(Path::new("log.mf4"), &bytes)
}

fn options(keys: &[(&str, &str)]) -> LogOptions {
    let mut options = LogOptions::default();
    keys.iter().for_each(|(key, value)| options.set(key, value).unwrap());
    options
}

#[test]
fn a_clock_in_milliseconds_and_values_that_stand_for_none() {
    let (_, mut log) =
        LOG_FORMATS.open(&file(), &options(&[("time_unit", "ms"), ("missing", "-9999")])).unwrap();
    let mut rows: Vec<(f64, f64)> = Vec::new();
    let mut take = |row: Row<'_>| {
        rows.push((row.t_s, row.values[0]));
        Ok(())
    };
    log.rows(&[0], &mut take).unwrap();
    let times: Vec<f64> = rows.iter().map(|row| row.0).collect();
    assert_eq!(times, [0.0, 0.01, 0.02]);
    assert!(rows[1].1.is_nan() && rows[2].1 == 1.1e5, "{rows:?}");
}

#[test]
fn channels_of_one_name_are_numbered() {
    let (_, log) = LOG_FORMATS.open(&file(), &LogOptions::default()).unwrap();
    let layout = log.layout();
    assert_eq!(layout.find("", "n_TC"), [0]);
    assert_eq!(layout.find("", "n_TC (2)"), [1]);
}

#[test]
fn keys_of_other_formats_are_refused() {
    for (key, value) in [("rate", "10 Hz"), ("decimal", ","), ("sheet", "Data")] {
        let error = LOG_FORMATS.open(&file(), &options(&[(key, value)])).err().unwrap().to_string();
        assert!(error.contains(key) && error.contains("time, time_unit, missing"), "{error}");
    }
}

/// Frames of a bus are named; signals next to them are read.
#[test]
fn undecoded_frames_of_a_bus_are_no_channels() {
    let open = |with_signals: bool| {
        let mut writer = falcon_mdf::Mf4Writer::new();
        let times = [0.0, 0.1, 0.2];
        let frames = writer.add_group(&times).unwrap();
        frames.add_channel("CAN_DataFrame.ID", "", &[256.0, 257.0, 256.0]).unwrap();
        frames.add_channel("CAN_DataFrame.DLC", "", &[8.0, 8.0, 8.0]).unwrap();
        if with_signals {
            writer.add_group(&times).unwrap().add_channel("n_TC", "rpm", &[1e5, 1e5, 1e5]).unwrap();
        }
        let mut bytes = Vec::new();
        writer.write(&mut bytes).unwrap();
        let file = LogFile::from_bytes(Path::new("bus.mf4"), &bytes);
        LOG_FORMATS.open(&file, &LogOptions::default()).map(|(_, log)| log.layout().clone())
    };
    assert!(open(false).unwrap_err().to_string().contains("asammdf"));
    let layout = open(true).unwrap();
    let names: Vec<&str> = layout.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["n_TC"]);
    assert!(layout.findings.contains(&LogFinding::BusFrames));
}
