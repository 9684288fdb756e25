//! Recordings whose clock was set while they were made.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::Channel;
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, ReadWarning, read_recording_from};
use std::collections::BTreeMap;
use std::path::Path;

const S: u64 = 1_000_000_000;

/// A temperature that counts the rows, exactly.
fn kelvin(row: usize) -> f64 {
    300.0 + row as f64 / 16.0
}

/// A recording of two topics at 10 Hz with these times of its rows.
fn read(times_ns: &[u64]) -> (BTreeMap<Channel, mapper_core::Series>, Vec<ReadWarning>) {
    let report = read_marked(times_ns, None, &[]);
    (report.recording.series, report.warnings)
}

/// The same with the start of the run and step markers: time in the file, and time of the run, s.
fn read_marked(times_ns: &[u64], start_ns: Option<u64>, markers: &[(u64, f64)]) -> ReadReport {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut file).unwrap();
    let schema = writer.add_schema("rig", "jsonschema", b"{}").unwrap();
    let topics =
        ["/a", "/b"].map(|topic| writer.add_channel(schema, topic, "json", &BTreeMap::new()).unwrap());
    for (row, time_ns) in times_ns.iter().enumerate() {
        for channel_id in topics {
            let header = mcap::records::MessageHeader {
                channel_id,
                sequence: 0,
                log_time: *time_ns + u64::from(channel_id) * 1000,
                publish_time: *time_ns,
            };
            writer.write_to_known_channel(&header, format!("{{\"x\": {}}}", kelvin(row)).as_bytes()).unwrap();
        }
    }
    if let Some(start_ns) = start_ns {
        let metadata = [("format", "2".to_owned()), ("start_time_ns", start_ns.to_string())];
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value)).into();
        let name = "mapper.recording".to_owned();
        writer.write_metadata(&mcap::records::Metadata { name, metadata }).unwrap();
        let channel_id = writer.add_channel(schema, "/step", "json", &BTreeMap::new()).unwrap();
        for (step, (log_time, t_s)) in (1..).zip(markers) {
            let (log_time, publish_time) = (*log_time, *log_time);
            let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time };
            let marker =
                format!("{{\"step\": {step}, \"kind\": \"point\", \"phase\": \"start\", \"t_s\": {t_s}}}");
            writer.write_to_known_channel(&header, marker.as_bytes()).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    let map = "channels:\n  T2: {topic: /a, field: x, unit: K}\n  T3: {topic: /b, field: x, unit: K}\n\
               constants: {T_amb: 25 degC}\n";
    let map = ChannelMap::from_yaml(map, Path::new("map.yaml")).unwrap();
    let file = file.into_inner();
    read_recording_from(&file, Path::new("test.mcap"), &map, &ReadOptions::default()).unwrap()
}

fn set_by(warnings: &[ReadWarning]) -> Vec<f64> {
    let by = warnings.iter().filter_map(|warning| match warning {
        ReadWarning::ClockSet { by_s } => Some(*by_s),
        _ => None,
    });
    by.collect()
}

#[test]
fn a_clock_that_is_set_back_loses_no_reading() {
    for (back_s, rows) in [(3, 4000), (100, 4000), (3600, 4000), (100, 300)] {
        let half = rows / 2;
        let times: Vec<u64> =
            (0..rows).map(|row| (10_000 - if row < half { 0 } else { back_s }) * S + row * S / 10).collect();
        let (series, warnings) = read(&times);
        assert_eq!(set_by(&warnings), [-(back_s as f64)]);
        for channel in [Channel::T2, Channel::T3] {
            let series = &series[&channel];
            assert_eq!(series.t_s.len() as u64, rows);
            let right = series.t_s.iter().zip(&series.values).enumerate().all(|(row, (t_s, value))| {
                // The two topics are a microsecond apart.
                (t_s - row as f64 / 10.0).abs() < 1e-5 && *value == kelvin(row)
            });
            assert!(right, "{channel} after {back_s} s");
        }
    }
}

/// Without step markers, only the readings show it: they go on as if no time had passed. Over a pause they have moved, and at rest they show
/// nothing.
#[test]
fn a_clock_that_is_set_forward_in_an_imported_log_is_found_by_its_readings() {
    for by_s in [7, 3600] {
        let times: Vec<u64> =
            (0..600).map(|row| (10_000 + if row < 300 { 0 } else { by_s }) * S + row * S / 10).collect();
        let (series, warnings) = read(&times);
        assert_eq!(set_by(&warnings), [by_s as f64]);
        for channel in [Channel::T2, Channel::T3] {
            let t_s = &series[&channel].t_s;
            assert!(
                t_s.iter().enumerate().all(|(row, t_s)| (t_s - row as f64 / 10.0).abs() < 1e-5),
                "{channel}"
            );
        }
    }
    // A table: a temperature that rises with time, by noise of a tenth of a kelvin, and one at rest.
    let noise = |row: u32| 0.1 * (f64::from(row * 7919 % 101) / 50.0 - 1.0);
    for (what, rate_k_s, passes, set) in [
        ("set", 0.5, false, vec![600.0]),
        ("paused", 0.5, true, vec![]),
        ("at rest, set", 0.0, false, vec![]),
        ("at rest, paused", 0.0, true, vec![]),
    ] {
        let mut text = String::from("t [s];T2 [K];T3 [K]\n");
        for row in 0..400 {
            let gap_s = if row < 200 { 0.0 } else { 600.0 };
            let run_s = 0.1 * f64::from(row);
            let t2_k = 330.0 + noise(row) + rate_k_s * (run_s + if passes { gap_s } else { 0.0 });
            text.push_str(&format!("{:.1};{t2_k:.3};{:.3}\n", run_s + gap_s, 800.0 + noise(row + 31)));
        }
        let map = "channels:\n  T2: {field: T2, unit: K}\n  T3: {field: T3, unit: K}\nconstants: {T_amb: 25 degC}\n";
        let map = ChannelMap::from_yaml(map, Path::new("map.yaml")).unwrap();
        let options = ReadOptions { logs: mapper_log_formats::LOG_FORMATS, ..ReadOptions::default() };
        let report = read_recording_from(text.as_bytes(), Path::new("log.csv"), &map, &options).unwrap();
        let found: Vec<f64> = set_by(&report.warnings).iter().map(|by_s| by_s.round()).collect();
        assert_eq!(found, set, "{what}: {:?}", report.warnings);
    }
}

#[test]
fn late_messages_are_no_set_clock() {
    let even: Vec<u64> = (0..4000).map(|row| 10_000 * S + row * S / 10).collect();
    // One message that is late, a packet of five seconds that is, and a clock that was lost for one message.
    let mut late = even.clone();
    late.swap(2000, 2100);
    let mut packet = even.clone();
    packet[2000..2100].rotate_left(50);
    let mut lost = even.clone();
    lost[2000] = 5_000 * S;
    for (what, times) in [("late", late), ("packet", packet), ("lost", lost)] {
        let (series, warnings) = read(&times);
        assert!(set_by(&warnings).is_empty(), "{what}: {warnings:?}");
        // The last row is where it was.
        let series = &series[&Channel::T2];
        assert_eq!(series.values.last(), Some(&kelvin(3999)), "{what}");
    }
}

/// Step markers have the time of the run, samples that of the clock: wherever it was set forward, they belong together again.
#[test]
fn samples_stay_at_their_steps_wherever_the_clock_was_set() {
    let start_ns = 10_000 * S;
    for (what, sets) in [
        ("before the first step", vec![(10.0, 600.0)]),
        ("at the first sample", vec![(0.05, 600.0)]),
        ("before the first sample, forward", vec![(0.0, 600.0)]),
        ("before the first sample, back", vec![(0.0, -600.0)]),
        ("three times in a step", vec![(35.05, 600.0), (40.05, 60.0), (45.05, 600.0)]),
        ("twice", vec![(10.05, 600.0), (75.05, 30.0)]),
    ] {
        let clock_ns = |run_s: f64| {
            let set_s: f64 = sets.iter().filter(|(at_s, _)| run_s >= *at_s).map(|(_, by_s)| by_s).sum();
            start_ns.checked_add_signed(((run_s + set_s) * 1e9) as i64).unwrap()
        };
        let times: Vec<u64> = (0..1200).map(|row| clock_ns(f64::from(row) / 10.0)).collect();
        let report = read_marked(&times, Some(start_ns), &[30.0, 60.0, 90.0].map(|t_s| (clock_ns(t_s), t_s)));
        let found_s: f64 = set_by(&report.warnings).iter().sum();
        let set_s: f64 = sets.iter().map(|(_, by_s)| by_s).sum();
        assert!((found_s - set_s).abs() < 0.5, "{what}: {:?}", report.warnings);
        let starts: Vec<f64> = report.recording.steps.iter().map(|step| step.start_s).collect();
        assert_eq!(starts, [30.0, 60.0, 90.0], "{what}");
        let series = &report.recording.series[&Channel::T2];
        assert_eq!(series.t_s.len(), 1200, "{what}");
        for (row, (t_s, value)) in series.t_s.iter().zip(&series.values).enumerate() {
            // A gap is closed to one interval, which may have been another one.
            assert!(
                (t_s - row as f64 / 10.0).abs() < 0.25 && *value == kelvin(row),
                "{what}: {row} at {t_s}"
            );
        }
    }
}
