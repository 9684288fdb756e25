//! Logs of other programs by a channel map.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::Channel;
use mapper_log_formats::LOG_FORMATS;
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, ReadWarning, RecordError, read_recording_from};
use std::path::Path;

/// Half a minute at one speed, half a minute at another, at this rate; P1 in mbar over ambient.
fn log(rate_hz: usize) -> String {
    let mut text = String::from("t [s];n [1/min];p1 [mbar rel];pAmb [mbar];T2 [degC]\n");
    for row in 0..60 * rate_hz {
        let t_s = row as f64 / rate_hz as f64;
        let fast = t_s >= 30.0;
        let (speed, inlet, outlet_degc) = if fast { (120_000, -12.5, 105.0) } else { (60_000, -2.5, 45.0) };
        text.push_str(&format!("{t_s};{speed};{inlet};990;{outlet_degc}\n"));
    }
    text
}

fn read(text: &str, map: &str) -> Result<ReadReport, RecordError> {
    let map = ChannelMap::from_yaml(map, Path::new("map.yaml")).unwrap();
    let options = ReadOptions { logs: LOG_FORMATS, ..ReadOptions::default() };
    read_recording_from(text.as_bytes(), Path::new("log.csv"), &map, &options)
}

const MAP: &str = "channels:\n  N: {field: n}\n  P1: {field: p1, gauge: true}\n  T2: {field: T2}\n";

#[test]
fn gauge_pressures_are_read_over_the_ambient_pressure_of_the_log_or_of_the_map() {
    for (ambient, expected_pa) in [("{field: pAmb}", 98_750.0), ("1 bar", 99_750.0)] {
        let read = read(&log(10), &format!("{MAP}ambient_pressure: {ambient}\n")).unwrap();
        let p1 = &read.recording.series[&Channel::P1];
        assert!((p1.values[0] - expected_pa).abs() < 1e-6, "{ambient}: {}", p1.values[0]);
        assert_eq!(read.recording.series[&Channel::T2].values[0], 318.15);
    }
    // A gauge pressure without anything to add it to is a mistake of the map.
    assert!(ChannelMap::from_yaml(MAP, Path::new("map.yaml")).is_err());
}

#[test]
fn a_constant_command_does_not_hide_the_steps_that_the_shaft_shows() {
    for constants in ["", "constants: {valve_command: \"0.7\"}\n"] {
        let read = read(&log(10), &format!("{MAP}ambient_pressure: 99 kPa\n{constants}")).unwrap();
        let starts: Vec<f64> = read.recording.steps.iter().map(|step| step.start_s).collect();
        assert_eq!(starts.len(), 2, "{constants}: {starts:?}");
        assert!(starts[0] == 0.0 && (starts[1] - 30.0).abs() <= 1.0, "{starts:?}");
    }
}

#[test]
fn a_fast_log_is_averaged_and_says_so() {
    let read = read(&log(100), &format!("{MAP}ambient_pressure: 99 kPa\n")).unwrap();
    assert!(read.warnings.contains(&ReadWarning::Averaged), "{:?}", read.warnings);
    assert_eq!(read.recording.series[&Channel::ShaftSpeed].t_s.len(), 600);
}

#[test]
fn units_that_contradict_the_log_are_reported_and_gauge_units_need_the_word() {
    let contradicting =
        read(&log(10), "channels:\n  N: {field: n, unit: rpm}\n  T2: {field: T2, unit: degF}\n").unwrap();
    let channels: Vec<Channel> = contradicting
        .warnings
        .iter()
        .filter_map(|warning| match warning {
            ReadWarning::UnitContradiction { channel, .. } => Some(*channel),
            _ => None,
        })
        .collect();
    assert_eq!(channels, [Channel::T2]);
    let error = read(&log(10), "channels:\n  P1: {field: p1}\n").unwrap_err().to_string();
    let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(error.contains("a gauge pressure") && error.contains("gauge: true"), "{error}");
}

#[test]
fn a_log_with_more_values_than_there_is_room_for_is_refused() {
    let bounded = |max_messages, max_values| {
        let map =
            ChannelMap::from_yaml("channels:\n  N: {field: n}\n  T2: {field: T2}\n", Path::new("map.yaml"));
        let options = ReadOptions { logs: LOG_FORMATS, max_messages, max_values, ..ReadOptions::default() };
        read_recording_from(log(100).as_bytes(), Path::new("log.csv"), &map.unwrap(), &options)
    };
    // 6000 rows, 600 means of each of two columns.
    assert!(bounded(6000, 1200).is_ok());
    let error = bounded(6000, 1000).unwrap_err().to_string();
    assert!(error.contains("more than 1000 values"), "{error}");
    let error = bounded(5999, 1200).unwrap_err().to_string();
    assert!(error.contains("more than 5999 rows"), "{error}");
}

/// The valve's own position, with noise of 0.1 % of it, in place of its command.
#[test]
fn a_measured_valve_position_keeps_the_steps_and_says_so() {
    let mut text = String::from("t [s];n [1/min];mc [g/s];valve [-]\n");
    for row in 0..3000 {
        let t_s = f64::from(row) / 10.0;
        let (speed, flow, opening) = match t_s {
            t_s if t_s < 100.0 => (60_000, 30.0, 0.7),
            t_s if t_s < 200.0 => (60_000, 24.0, 0.5),
            _ => (90_000, 40.0, 0.5),
        };
        let noise = 1e-3 * (f64::from(row) * 12.9898).sin();
        text.push_str(&format!("{t_s};{speed};{flow};{}\n", opening * (1.0 + noise)));
    }
    let map =
        "channels:\n  N: {field: n}\n  m_c: {field: mc}\n  valve_command: {field: valve, unit: \"1\"}\n";
    let read = read(&text, map).unwrap();
    let steps: Vec<(f64, f64)> =
        read.recording.steps.iter().map(|step| (step.start_s, step.valve_opening_ratio)).collect();
    assert_eq!(steps.len(), 3, "{steps:?}");
    for ((start_s, opening), expected) in steps.iter().zip([(0.0, 0.7), (100.0, 0.5), (200.0, 0.5)]) {
        // A jump is seen within a second; of 500 samples the median is that of noise over its root.
        assert!((start_s - expected.0).abs() <= 1.0 && (opening - expected.1).abs() < 2e-4, "{steps:?}");
    }
    let measured = |warning: &&ReadWarning| matches!(warning, ReadWarning::MeasuredValve { .. });
    assert_eq!(read.warnings.iter().filter(measured).count(), 1, "{:?}", read.warnings);
    // Identification waits for commands to come to rest: the position is constant within each step.
    let valve = &read.recording.series[&Channel::ValveCommand].values;
    assert_eq!(valve.windows(2).filter(|pair| pair[0] != pair[1]).count(), 2);
}

#[test]
fn what_a_pressure_is_measured_from_is_not_overruled_by_its_unit() {
    for (header, source, remedy) in [
        ("p2 [bar rel]", "{field: p2, unit: bar}", "write `gauge: true`"),
        ("p2 [bar abs]", "{field: p2, unit: bar, gauge: true}", "delete `gauge: true`"),
        ("p2 [bar abs]", "{field: p2, gauge: true}", "delete `gauge: true`"),
        ("p2 [bar rel]", "{field: p2, unit: bar, gauge: true}", ""),
        ("p2 [bar]", "{field: p2, unit: bar, gauge: true}", ""),
        ("p2 [bar]", "{field: p2, unit: bar}", ""),
    ] {
        let text =
            log(10).replace("p1 [mbar rel]", header).replace(";-12.5;", ";1.9;").replace(";-2.5;", ";1.2;");
        let map =
            format!("channels:\n  N: {{field: n}}\n  P2: {source}\nambient_pressure: {{field: pAmb}}\n");
        match read(&text, &map) {
            Ok(_) => assert!(remedy.is_empty(), "{header}, {source}"),
            Err(error) => assert!(!remedy.is_empty() && error.to_string().contains(remedy), "{error}"),
        }
    }
    let map = "channels:\n  P1: {field: p1, gauge: true}\nambient_pressure: {field: pAmb, unit: mbar}\n";
    let error = read(&log(10).replace("pAmb [mbar]", "pAmb [mbar rel]"), map).unwrap_err().to_string();
    assert!(error.contains("absolute ambient pressure"), "{error}");
}

#[test]
fn gauge_readings_and_the_ambient_pressure_are_held_against_what_is_possible() {
    for (header, map, expected) in [
        // 100 to 190 kPa over ambient, read as bar: no boost is that high.
        ("p2", "P2: {field: p2, unit: bar, gauge: true}\nambient_pressure: 99 kPa", "write `unit: kPa`"),
        // 100 to 190 kPa are absolute ones, if they are read in kPa; over 990 kPa none is.
        (
            "p2",
            "P2: {field: p2, unit: kPa, gauge: true}\nambient_pressure: 990 kPa",
            "between 50 and 110 kPa",
        ),
        (
            "p2",
            "P2: {field: p2, unit: kPa, gauge: true}\nambient_pressure: {field: pAmb, unit: kPa}",
            "write `unit: mbar`",
        ),
        ("p2", "P2: {field: p2, unit: kPa, gauge: true}\nambient_pressure: 0.98 bar", ""),
        ("p2", "P2: {field: p2, unit: kPa, gauge: true}\nambient_pressure: {field: pAmb, unit: mbar}", ""),
    ] {
        let text =
            log(10).replace("p1 [mbar rel]", header).replace(";-12.5;", ";190;").replace(";-2.5;", ";100;");
        let whole = ["channels:\n  N: {field: n}\n  ", map, "\n"].concat();
        match read(&text, &whole) {
            Ok(_) => assert!(expected.is_empty(), "{map}"),
            Err(error) => {
                let words = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
                assert!(!expected.is_empty() && words.contains(expected), "{map}: {error}");
            }
        }
    }
}

#[test]
fn two_runs_in_one_file_are_refused_where_the_second_begins() {
    let one = log(10);
    let two = [one.as_str(), one.split_once('\n').unwrap().1].concat();
    let error = read(&two, "channels:\n  N: {field: n}\n").unwrap_err().to_string();
    assert!(error.contains("from 59.9 s to 0 s in row 601 of the data"), "{error}");
}

#[test]
fn a_single_wrong_time_is_left_out_and_reported() {
    let text = format!("{}1e9;60000;-2.5;990;45\n", log(10));
    let read = read(&text, "channels:\n  N: {field: n}\n").unwrap();
    assert!(
        read.warnings.contains(&ReadWarning::StrayTimes { count: 1, first_s: 1e9 }),
        "{:?}",
        read.warnings
    );
    let end_s = read.recording.steps.last().unwrap().end_s;
    assert!(end_s < 60.0, "{end_s}");
}

/// The channel map that the documentation gives to copy reads a table with its columns.
#[test]
fn the_map_to_copy_serves_a_table() {
    let text = include_str!("../../../examples/channels/stand_log.yaml");
    let map = ChannelMap::from_yaml(text, Path::new("stand_log.yaml")).unwrap();
    let columns = [
        ("n_TC", 1e5),
        ("m_dot_C", 0.05),
        ("p1_C", -1.0),
        ("T1_C", 25.0),
        ("p2_C", 80.0),
        ("T2_C", 110.0),
        ("T_housing_C", 80.0),
        ("m_dot_T", 0.05),
        ("p3_T", 90.0),
        ("T3_T", 500.0),
        ("p4_T", 1.0),
        ("T4_T", 420.0),
        ("T_housing_T", 300.0),
        ("T_oil", 90.0),
        ("T_cell", 24.0),
        ("p3_set", 190.0),
        ("valve_set", 70.0),
        ("p_amb", 99.0),
    ];
    let mut table = format!("t [s];{}\n", columns.map(|(name, _)| name).join(";"));
    for row in 0..600 {
        let cells = columns.map(|(_, value)| value.to_string()).join(";");
        table.push_str(&format!("{};{cells}\n", f64::from(row) / 10.0));
    }
    let options = ReadOptions { logs: LOG_FORMATS, ..ReadOptions::default() };
    let read = read_recording_from(table.as_bytes(), Path::new("log.csv"), &map, &options).unwrap();
    assert_eq!(read.recording.series.len(), columns.len() - 1, "all but the ambient pressure");
    assert_eq!((read.recording.steps.len(), read.recording.steps[0].valve_opening_ratio), (1, 0.7));
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
}
