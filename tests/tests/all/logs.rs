//! Logs of other programs, written with their own libraries, are inspected, mapped and identified.

use mapper_tests::{CampaignFile, Finished, mapper, python, repository, scratch, shared_run};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A run of four points, and the campaign that describes its machine.
struct Run {
    campaign: CampaignFile,
    recording: PathBuf,
    directory: tempfile::TempDir,
}

impl Run {
    fn new() -> Run {
        let mut text = std::fs::read_to_string(repository().join("campaigns/gap_rig.yaml")).unwrap();
        for (old, new) in [
            ("[90 krpm, 150 krpm, 50 krpm, 130 krpm, 70 krpm, 110 krpm]", "[90 krpm, 130 krpm]"),
            ("openings: [0.5, 0.7, 1.0]", "openings: [0.7, 1.0]"),
            ("dwell: 120 s", "dwell: 60 s"),
            ("end: 110 s}", "end: 55 s}"),
            // Each jump by itself: a common fit of four points ends within its own tolerance only, not to the last digit of a log, and
            // influences the first step, whose begin no jump marks.
            ("method: joint ", "method: dynamic "),
        ] {
            assert_eq!(text.matches(old).count(), 1, "`{old}` in the campaign of the gap rig");
            text = text.replace(old, new);
        }
        let (campaign, directory) = (CampaignFile::of(text), scratch());
        let recording = shared_run(&campaign).run.join("recording.mcap");
        Run { campaign, recording, directory }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// The recording as logs of these kinds with their names, and what their writer says of the last.
    fn logs<const N: usize>(&self, kinds: [(&str, &str); N]) -> ([PathBuf; N], Value) {
        let targets = kinds.map(|(_, name)| self.file(name));
        let each = targets.iter().zip(&kinds);
        let each = each.flat_map(|(target, (kind, _))| [target.as_os_str(), kind.as_ref()]);
        let written = python("write_log.py", [self.recording.as_os_str()].into_iter().chain(each));
        (targets, written)
    }

    fn identify(&self, log: &Path, channels: &Path) -> Finished {
        mapper([
            "identify".as_ref(),
            log.as_os_str(),
            "--channels".as_ref(),
            channels.as_os_str(),
            "--campaign".as_ref(),
            self.campaign.path.as_os_str(),
            "--json".as_ref(),
        ])
    }
}

/// The channel map that a log suggests, in a new file.
fn proposed(log: &Path, name: &str) -> PathBuf {
    let channels = log.with_file_name(name);
    mapper([
        "log".as_ref(),
        "inspect".as_ref(),
        log.as_os_str(),
        "--write-channels".as_ref(),
        channels.as_os_str(),
    ])
    .exits(0);
    channels
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn every_log_format_gives_identical_points() {
    let run = Run::new();
    // By one process: its libraries take longer to load than to write.
    let ([mdf, mdf_3, mcap, csv, mat, hdf5, parquet, arrow, tdms, counted, dated, xlsx], _) = run.logs([
        ("mdf4", "log.mf4"),
        ("mdf3", "log.mdf"),
        ("mcap", "log.mcap"),
        ("csv", "log.csv"),
        ("mat", "log.mat"),
        ("mat73", "log_73.mat"),
        ("parquet", "log.parquet"),
        ("arrow", "log.arrow"),
        ("tdms", "log.tdms"),
        ("tdms_time", "counted.tdms"),
        ("tdms_date", "dated.tdms"),
        ("xlsx", "log.xlsx"),
    ]);
    let with = |log: &Path, channels: &Path| run.identify(log, channels).exits(0).json()["points"].clone();
    let points = |log: &Path| {
        let name = log.file_name().unwrap().to_str().unwrap();
        with(log, &proposed(log, &format!("{name}.yaml")))
    };
    // The same groups as in the MDF file, hence the same channel map.
    let channels = proposed(&mdf, "groups.yaml");
    let expected = with(&mcap, &channels);
    assert_eq!(expected.as_array().unwrap().len(), 4);
    assert_eq!(with(&mdf, &channels), expected);
    for log in [mdf_3, csv, parquet, arrow, tdms, counted] {
        assert_eq!(points(&log), expected, "{}", log.display());
    }
    // Names of variables have no place for the unit of the valve, which is not proposed then; no number depends on it.
    for mat in [mat, hdf5] {
        let found = points(&mat);
        for (found, expected) in found.as_array().unwrap().iter().zip(expected.as_array().unwrap()) {
            for key in ["speed_rpm", "flow_kg_s", "pressure_ratio", "eta", "h_w_m2k"] {
                assert_eq!(found[key], expected[key], "{key}");
            }
        }
    }
    // Its library would read what lies behind a date at the wrong places.
    let refused = mapper(["log".as_ref(), "inspect".as_ref(), dated.as_os_str()]).exits(6);
    assert!(refused.stderr.contains("`time` does not contain plain numbers"), "{}", refused.stderr);
    // Excel's files keep 15 to 16 of the 17 digits of a number.
    for (found, expected) in points(&xlsx).as_array().unwrap().iter().zip(expected.as_array().unwrap()) {
        for key in ["speed_rpm", "flow_kg_s", "pressure_ratio", "eta", "h_w_m2k"] {
            let (Some(a), Some(b)) = (found[key].as_f64(), expected[key].as_f64()) else {
                assert_eq!(found[key], expected[key]);
                continue;
            };
            assert!((a / b - 1.0).abs() < 1e-8, "{key}: {a} against {b}");
        }
    }
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn a_test_stand_log_becomes_points_with_two_commands() {
    let run = Run::new();
    let ([log], written) = run.logs([("stand", "stand.txt")]);
    let channels = proposed(&log, "channels.yaml");
    let found = run.identify(&log, &channels).exits(0).json();
    let expected =
        mapper(["identify".as_ref(), run.recording.as_os_str(), "--json".as_ref()]).exits(0).json();
    let points = |value: &Value| value["points"].as_array().unwrap().clone();
    let (found, expected) = (points(&found), points(&expected));
    assert_eq!(found.len(), expected.len());
    let ahead_s = written["ahead_s"].as_f64().unwrap();
    let starts = written["steps_s"].as_array().unwrap();
    for (index, (found, expected)) in found.iter().zip(&expected).enumerate() {
        // The first step begins at rest, with the warm-up; the others where the lab jumped.
        if index > 0 {
            let start_s = found["window"]["start_s"].as_f64().unwrap() - 10.0;
            let truth_s = starts[index].as_f64().unwrap() + ahead_s;
            assert!(
                (start_s - truth_s).abs() <= 1.0,
                "step {index} found at {start_s} s, made at {truth_s} s"
            );
        }
        // What is held shows the same speed and flow: steps that begin up to a second apart move the means by less.
        for (key, tolerance_ratio) in [("speed_rpm", 1e-3), ("flow_kg_s", 2e-3), ("pressure_ratio", 1e-3)] {
            let (a, b) = (found[key].as_f64().unwrap(), expected[key].as_f64().unwrap());
            assert!((a / b - 1.0).abs() < tolerance_ratio, "step {index}: {key} {a} against {b}");
        }
        // Efficiencies agree within the noise of each.
        if let (Some(a), Some(b)) = (found["eta"].as_f64(), expected["eta"].as_f64()) {
            let noise = expected["eta_uncertainty"]["noise_standard_error"].as_f64().unwrap();
            assert!((a - b).abs() < 3.0 * noise + 1e-3, "step {index}: {a} against {b}");
        }
    }
    assert!(found.iter().filter(|point| point["eta"].is_number()).count() >= 3);

    // The map is readable, although the valve was not recorded.
    let out = run.file("map");
    let given = ["identify".as_ref(), log.as_os_str(), "--channels".as_ref(), channels.as_os_str()];
    let campaign = ["--campaign".as_ref(), run.campaign.path.as_os_str(), "--out".as_ref(), out.as_os_str()];
    mapper(given.into_iter().chain(campaign)).exits(0);
    for format in ["json", "csv"] {
        let (map, copy) = (out.join(format!("map.{format}")), out.join(format!("copy_of_{format}.json")));
        mapper(["map".as_ref(), "convert".as_ref(), map.as_os_str(), copy.as_os_str()]).exits(0);
    }
}

/// A file in a directory of its own.
fn written(text: &str, name: &str) -> (tempfile::TempDir, PathBuf) {
    let directory = scratch();
    let path = directory.path().join(name);
    std::fs::write(&path, text).unwrap();
    (directory, path)
}

/// A compressor that is run up once, in kg/h, mbar over ambient and degC.
fn small_log() -> String {
    let mut text =
        String::from("t [s];n_TC [U/min];m_L [kg/h];p1 [mbar rel];p2 [mbar rel];T1 [°C];T2 [°C]\n");
    for row in 0..600 {
        let up = f64::from((row - 300).clamp(0, 50)) / 50.0;
        let line = format!(
            "{:.1};{:.0};{:.2};{:.1};{:.1};{:.2};{:.2}\n",
            f64::from(row) / 10.0,
            60e3 + 60e3 * up,
            120.0 + 150.0 * up,
            -5.0 - 10.0 * up,
            250.0 + 600.0 * up,
            22.0,
            50.0 + 55.0 * up
        );
        text.push_str(&line.replace('.', ","));
    }
    text
}

#[test]
fn the_proposed_channel_map_loads_unchanged_and_replaces_no_file() {
    let (_directory, log) = written(&small_log(), "log.csv");
    let channels = proposed(&log, "channels.yaml");
    let text = std::fs::read_to_string(&channels).unwrap();
    for line in [
        "P1: {field: p1, unit: mbar, gauge: true}",
        "m_c: {field: m_L, unit: kg/h}",
        "ambient_pressure: unknown",
    ] {
        assert!(text.contains(line), "`{line}` in\n{text}");
    }
    mapper_recording::ChannelMap::load(&channels).unwrap();
    let again = mapper([
        "log".as_ref(),
        "inspect".as_ref(),
        log.as_os_str(),
        "--write-channels".as_ref(),
        channels.as_os_str(),
    ]);
    assert_ne!(again.code, Some(0));
    assert_eq!(std::fs::read_to_string(&channels).unwrap(), text);
}

#[test]
fn all_mistakes_of_a_channel_map_are_reported_with_their_positions() {
    let (_directory, log) = written(&small_log(), "log.csv");
    let channels = log.with_file_name("channels.yaml");
    let identify = |text: &str| {
        std::fs::write(&channels, text).unwrap();
        mapper(["identify".as_ref(), log.as_os_str(), "--channels".as_ref(), channels.as_os_str()])
            .exits(3)
            .stderr
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    let names =
        identify("channels:\n  N: {field: n_TK}\n  T2: {field: T9}\n  m_c: {field: m_L, topic: Daten}\n");
    for expected in [
        "no column `n_TK`",
        "did you mean `n_TC`?",
        "no column `T9`",
        "no group `Daten`",
        ":2:",
        ":3:",
        ":4:",
        "^^^^",
    ] {
        assert!(names.contains(expected), "`{expected}` in\n{names}");
    }
    // Refused before anything is computed, with what would be right.
    let units = identify(
        "channels:\n  N: {field: n_TC, unit: krpm}\n  m_c: {field: m_L, unit: kg/s}\n  T1: {field: T1, unit: K}\n",
    );
    for expected in
        ["lie between 60000 and 120000 krpm", "write `unit: rpm`", "write `unit: kg/h`", "write `unit: degC`"]
    {
        assert!(units.contains(expected), "`{expected}` in\n{units}");
    }
    // A header that contradicts the map is refused before the data are read.
    let header = identify("channels:\n  N: {field: n_TC}\n  P1: {field: p1, unit: mbar}\n");
    assert!(header.contains("write `gauge: true`") && header.contains(":3:"), "{header}");
}

/// A recording that was converted is the same recording: as a table, whose columns name themselves, and as a recording with its steps.
#[test]
fn a_converted_recording_gives_the_same_points() {
    let run = Run::new();
    let convert = |out: &Path, code: i32| {
        mapper(["log".as_ref(), "convert".as_ref(), run.recording.as_os_str(), out.as_os_str()]).exits(code)
    };
    let points = |finished: Finished| -> Vec<Value> {
        let found: Value = serde_json::from_str(&finished.exits(0).stdout).unwrap();
        found["points"].as_array().unwrap().iter().map(|point| point["eta"].clone()).collect()
    };
    let campaign = run.campaign.path.as_os_str();
    let identify = |file: &Path| {
        mapper(["identify".as_ref(), file.as_os_str(), "--campaign".as_ref(), campaign, "--json".as_ref()])
    };
    let original = points(identify(&run.recording));
    // No jump leads to the first point.
    assert!(original.len() == 4 && original[1..].iter().all(Value::is_number), "{original:?}");

    let (table, recording) = (run.file("converted.csv"), run.file("converted.mcap"));
    convert(&table, 0);
    convert(&recording, 0);
    assert_eq!(points(identify(&recording)), original);
    let from_table = points(run.identify(&table, &proposed(&table, "converted.yaml")));
    assert_eq!(from_table.len(), original.len());
    for (found, expected) in from_table.iter().zip(&original).skip(1) {
        let difference = found.as_f64().unwrap() - expected.as_f64().unwrap();
        assert!(difference.abs() < 1e-3, "{from_table:?} {original:?}");
    }

    let before = std::fs::read(&table).unwrap();
    convert(&table, 1);
    assert_eq!(std::fs::read(&table).unwrap(), before);
    convert(&run.file("converted.xyz"), 3);
}

/// MDF 4 as asammdf reads it: the numbers of the table, to the bit, with their units; and no sample where the channel has none.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn a_converted_recording_is_read_by_asammdf() {
    let run = Run::new();
    let (mdf, table) = (run.file("converted.mf4"), run.file("converted.csv"));
    for out in [&mdf, &table] {
        mapper(["log".as_ref(), "convert".as_ref(), run.recording.as_os_str(), out.as_os_str()]).exits(0);
    }
    let theirs = python("read_mdf.py", [&mdf]);
    let text = std::fs::read_to_string(&table).unwrap();
    let mut rows = text.lines();
    let headings: Vec<&str> = rows.next().unwrap().split(',').collect();
    let rows: Vec<Vec<Option<f64>>> =
        rows.map(|row| row.split(',').map(|cell| cell.parse().ok()).collect()).collect();
    assert!(headings.len() > 12 && rows.len() > 1000);
    for (column, heading) in headings.iter().enumerate().skip(1) {
        let (name, unit) = heading.split_once(" [").unwrap_or((heading, ""));
        let channel = &theirs[name];
        assert_eq!(channel["unit"].as_str().unwrap(), unit.trim_end_matches(']'), "{heading}");
        let samples = rows.iter().filter_map(|row| Some((row[0]?, row[column]?)));
        let (times, values): (Vec<f64>, Vec<f64>) = samples.unzip();
        let numbers = |key: &str| -> Vec<f64> {
            channel[key].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
        };
        assert!(numbers("t_s") == times && numbers("values") == values, "{heading}");
    }
}
