//! Damaged and hostile logs through everything that identification reads of them: an answer, no panic, no hang.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_log_formats::LOG_FORMATS;
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, RecordError, read_recording_from};
use proptest::prelude::*;
use std::path::Path;

const MAP: &str = "channels:\n  N: {field: n, unit: rpm}\n  P1: {field: p1, unit: mbar, gauge: true}\n  T2: {field: T2, unit: degC}\n  \
                   valve_command: {field: valve, unit: \"1\"}\nambient_pressure: {field: pAmb, unit: mbar}\n";

fn read(bytes: &[u8]) -> Result<ReadReport, RecordError> {
    let map = ChannelMap::from_yaml(MAP, Path::new("map.yaml")).unwrap();
    let options = ReadOptions { logs: LOG_FORMATS, ..ReadOptions::default() };
    read_recording_from(bytes, Path::new("log.csv"), &map, &options)
}

/// A log whose times and openings are given.
fn log(times: &[f64], openings: &[f64]) -> String {
    let mut text = String::from("t [s];n;p1;T2;valve;pAmb\n");
    for (row, t_s) in times.iter().enumerate() {
        let opening = openings[row % openings.len()];
        text.push_str(&format!("{t_s};{};{};{};{opening};990\n", 60_000 + 3_000 * (row / 40), -2.5, 45.0));
    }
    text
}

fn regular() -> Vec<f64> {
    (0..200).map(|row| f64::from(row) / 10.0).collect()
}

#[test]
fn the_log_itself_is_read() {
    let read = read(log(&regular(), &[0.7]).as_bytes()).unwrap();
    assert_eq!(read.recording.series.len(), 4);
    assert!(read.recording.steps.iter().all(|step| step.end_s <= 20.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_flipped_bytes_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut bytes = log(&regular(), &[0.7, 0.7001]).into_bytes();
        for (index, value) in &flips {
            let at = index.index(bytes.len());
            bytes[at] = *value;
        }
        drop(read(&bytes));
    }

    /// Times of any size anywhere: what is read lies within what the clock says, in order, and the steps within the samples.
    #[test]
    fn any_times_give_an_answer(
        wrong in prop::collection::vec((any::<prop::sample::Index>(), any::<f64>()), 0..6),
        openings in prop::collection::vec(0.0..2.0f64, 1..5),
    ) {
        let mut times = regular();
        for (index, t_s) in &wrong {
            let at = index.index(times.len());
            times[at] = *t_s;
        }
        if let Ok(read) = read(log(&times, &openings).as_bytes()) {
            for series in read.recording.series.values() {
                prop_assert!(series.t_s.is_sorted_by(|a, b| a < b));
            }
            let last_s = read.recording.series.values().filter_map(|s| s.t_s.last()).fold(f64::MIN, |a, b| a.max(*b));
            prop_assert!(read.recording.steps.iter().all(|step| step.end_s <= last_s));
        }
    }
}
