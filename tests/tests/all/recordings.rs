//! Recordings: equal bytes for equal seeds, one directory per run, readable by independent programs.

use mapper_core::{CHANNELS, Group, MODELLED_CHANNELS};
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_tests::{
    CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper, mapper_command, only_run, python, scratch,
    shared_run,
};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// Runs the campaign into `out`; gives what it printed.
fn run_into(campaign: &Path, out: &Path) -> Value {
    let arguments =
        ["run".as_ref(), campaign.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    mapper(arguments).exits(0).json()
}

fn recording_of(result: &Value) -> PathBuf {
    PathBuf::from(result["recording"].as_str().unwrap())
}

fn points_of(recording: &Path) -> Vec<Value> {
    let result = mapper(["identify".as_ref(), recording.as_os_str(), "--json".as_ref()]).exits(0).json();
    result["points"].as_array().unwrap().clone()
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let scratch = scratch();
    let campaign = CampaignFile::shipped_with(SHORT_GRID);
    let bytes = |campaign: &Path, out: &str| {
        let result = run_into(campaign, &scratch.path().join(out));
        std::fs::read(recording_of(&result)).unwrap()
    };
    let first = std::fs::read(recording_of(&shared_run(&campaign).result)).unwrap();
    assert!(first == bytes(&campaign.path, "second"), "two runs of one campaign differ");
    let mut replacements = SHORT_GRID.to_vec();
    replacements.push(("seed: 1 ", "seed: 2 "));
    let other = CampaignFile::shipped_with(&replacements);
    assert!(first != bytes(&other.path, "third"), "the seed has no effect");
}

#[test]
fn simultaneous_runs_have_separate_directories() {
    let scratch = scratch();
    let campaign = CampaignFile::shipped_with(&[SHORT_GRID, SINGLE_STEP_METHOD].concat());
    let out = scratch.path();
    let earlier = std::fs::read(recording_of(&shared_run(&campaign).result)).unwrap();
    // Started together: at least two of them begin within one second.
    let started: Vec<_> = (0..4)
        .map(|_| {
            mapper_command(["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref()])
                .arg("--out")
                .arg(out)
                .stdout(Stdio::piped())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap()
        })
        .collect();
    let runs: BTreeSet<String> = started
        .into_iter()
        .map(|child| {
            let finished = mapper_tests::Finished::from(child.wait_with_output().unwrap()).exits(0);
            finished.json()["run"].as_str().unwrap().to_owned()
        })
        .collect();
    assert_eq!(runs.len(), 4, "{runs:?}");
    for run in &runs {
        let recording = std::fs::read(Path::new(run).join("recording.mcap")).unwrap();
        assert!(recording == earlier, "{run} is not whole");
    }
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn an_independent_reader_finds_what_the_run_recorded() {
    let replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
    let campaign = CampaignFile::shipped_with(&replacements);
    let recording = recording_of(&shared_run(&campaign).result);
    let seen = python("read_recording.py", [&recording]);
    assert_eq!(seen["complete"], true);

    // Warm-up 60 s and four steps of 120 s at 10 Hz. The lab may or may not give the sample at time 0.
    let samples = seen["topics"]["/rig/compressor"]["messages"].as_u64().unwrap();
    assert!((5400..=5401).contains(&samples), "{samples} samples");
    for group in Group::ALL {
        let topic = &seen["topics"][group.topic()];
        assert_eq!(topic["messages"], samples, "{}", group.topic());
        assert_eq!([&topic["message_encoding"], &topic["schema_encoding"]], ["json", "jsonschema"]);
        for row in CHANNELS.iter().take(MODELLED_CHANNELS).filter(|row| row.group == group) {
            assert_eq!(topic["schema_units"][row.field], row.channel.unit(), "{}", row.symbol);
        }
    }
    assert_eq!(seen["topics"]["/truth/model"]["messages"], samples);
    // A start and an end for each step.
    assert_eq!(seen["topics"]["/step"]["messages"], 8);

    let attached = |name: &str| seen["attachments"][name]["text"].as_str().unwrap().to_owned();
    assert_eq!(attached("campaign.yaml"), campaign.text);
    let plan: Value = serde_json::from_str(&attached("plan.json")).unwrap();
    assert_eq!(plan["steps"].as_array().unwrap().len(), 4);
    let run = recording.parent().unwrap();
    assert_eq!(attached("plan.json"), std::fs::read_to_string(run.join("plan.json")).unwrap());
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn an_independent_reader_sees_the_same_values() {
    let recording = recording_of(&shared_run(&CampaignFile::shipped_with(SHORT_GRID)).result);
    let theirs = python("columns.py", [&recording]);
    let ours = read_recording(&recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
    assert_eq!(ours.warnings, []);
    assert_eq!(ours.recording.series.len(), MODELLED_CHANNELS);
    for (channel, series) in &ours.recording.series {
        let info = channel.info();
        let column = |field: &str| theirs[info.group.topic()][field].as_array().unwrap();
        let values: Vec<f64> = column(info.field).iter().map(|value| value.as_f64().unwrap()).collect();
        // To the last bit: both read the shortest text of a number.
        assert_eq!(series.values, values, "{channel}");
        let times: Vec<f64> =
            column("log_time_ns").iter().map(|ns| ns.as_u64().unwrap() as f64 / 1e9).collect();
        assert_eq!(series.t_s.len(), times.len());
        // Times are kept in whole nanoseconds.
        assert!(series.t_s.iter().zip(&times).all(|(a, b)| (a - b).abs() < 1e-9), "{channel}");
        let sequence: Vec<u64> = column("sequence").iter().map(|value| value.as_u64().unwrap()).collect();
        assert!(sequence.windows(2).all(|pair| pair[1] == pair[0] + 1), "{channel}: samples are missing");
    }
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn identification_does_not_read_the_truth() {
    let scratch = scratch();
    let recording = recording_of(&shared_run(&CampaignFile::shipped_with(SHORT_GRID)).result);
    let stripped = scratch.path().join("stripped.mcap");
    let copied = python("strip_truth.py", [&recording, &stripped]);
    assert!(copied["left_out"].as_u64().unwrap() > 5000, "{copied}");

    let mut with_truth = points_of(&recording);
    let without_truth = points_of(&stripped);
    assert_eq!(with_truth.len(), 4);
    for point in &mut with_truth {
        assert!(point["truth"].is_object(), "{point}");
        point["truth"] = Value::Null;
    }
    assert_eq!(with_truth, without_truth);
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn scipy_finds_the_same_efficiency_and_heat_transfer() {
    let scratch = scratch();
    // Once as shipped, once with a share of the area before the wheel, so that eq. 1 counts.
    for (number, alpha) in ["alpha_area: 0  ", "alpha_area: 0.2"].into_iter().enumerate() {
        let mut replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
        // The independent fit is one of dry air by the paper's definition.
        replacements.push(("humidity: 50 %", "humidity: 0 %"));
        replacements.push(("efficiency: enthalpy ", "efficiency: kappa_of_T1 "));
        replacements.push(("  alpha_area: 0       #", ""));
        // Known for certain, so that points are good.
        let line = format!("  alpha_area_sigma: 0\n  {alpha}     #");
        replacements.last_mut().unwrap().1 = &line;
        let campaign = CampaignFile::shipped_with(&replacements);
        let result = run_into(&campaign.path, &scratch.path().join(number.to_string()));
        let points: Vec<&Value> =
            result["points"].as_array().unwrap().iter().filter(|point| point["verdict"] == "good").collect();
        assert!(points.len() >= 2, "{} good points", points.len());
        let mut arguments = vec![recording_of(&result).to_str().unwrap().to_owned(), "29e-3".to_owned()];
        arguments.push(alpha.trim().rsplit(' ').next().unwrap().to_owned());
        for point in &points {
            arguments.push(point["window"]["start_s"].to_string());
            arguments.push(point["window"]["end_s"].to_string());
        }
        let fits = python("fit_steps.py", &arguments);
        for (point, fit) in points.iter().zip(fits.as_array().unwrap()) {
            let value = |object: &Value, key: &str| object[key].as_f64().unwrap();
            let [eta, scipy_eta] = [value(point, "eta"), value(fit, "eta")];
            assert!(fit["samples"].as_u64().unwrap() > 100, "{fit}");
            // Both find the minimum of one function: 1e-4 leaves room for how they stop, not for another model.
            assert!((eta - scipy_eta).abs() < 1e-4, "step {}: eta {eta}, scipy {scipy_eta}", point["step"]);
            let [h, scipy_h] = [value(point, "h_w_m2k"), value(fit, "h_w_m2k")];
            assert!((h / scipy_h - 1.0).abs() < 1e-3, "step {}: h {h}, scipy {scipy_h}", point["step"]);
            let [rms, scipy_rms] = [value(point, "residual_rms_k"), value(fit, "residual_rms_k")];
            assert!((rms / scipy_rms - 1.0).abs() < 1e-6, "residual {rms} K, scipy {scipy_rms} K");
        }
    }
}

#[test]
fn a_stored_plan_is_run_and_a_stale_one_refused() {
    let scratch = scratch();
    let campaign = CampaignFile::shipped_with(SHORT_GRID);
    let plan = scratch.path().join("plan.json");
    mapper(["plan".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), plan.as_os_str()]).exits(0);
    let run = |campaign: &CampaignFile| {
        let arguments = ["run".as_ref(), campaign.path.as_os_str(), "--plan".as_ref(), plan.as_os_str()];
        let out = campaign.runs();
        mapper(arguments.into_iter().chain(["--json".as_ref(), "--out".as_ref(), out.as_os_str()]))
    };
    run(&campaign).exits(0);
    let stored = std::fs::read_to_string(&plan).unwrap();
    let run_by = std::fs::read_to_string(only_run(&campaign.runs()).join("plan.json")).unwrap();
    // The same to the byte, but for the description that the rig gave of itself, which no plan knows before a run.
    let of_the_rig = |line: &&str| line.trim_start().starts_with("\"rig_sha256\"");
    assert_eq!(run_by.lines().filter(of_the_rig).count(), 1);
    let without: Vec<&str> = run_by.lines().filter(|line| !of_the_rig(line)).collect();
    assert_eq!(without.join("\n").replace("null,\n  }", "null\n  }"), stored.trim_end());

    let mut replacements = SHORT_GRID.to_vec();
    replacements.push(("dwell: 120 s ", "dwell: 110 s "));
    let changed = CampaignFile::shipped_with(&replacements);
    let refused = run(&changed).exits(4);
    assert!(refused.stderr.contains("stale") && refused.stderr.contains("campaign"), "{}", refused.stderr);
    assert_eq!(refused.json()["code"], 4);
    assert!(!changed.runs().exists(), "a refused run made a directory");
}

/// Other topics' fields, degC and kPa, no step markers, no campaign: the channel map makes up for all of it.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn a_recording_of_another_program_gives_the_same_points() {
    let scratch = scratch();
    let mut replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
    // A channel map alone has no humidity.
    replacements.push(("humidity: 50 %", "humidity: 0 %"));
    // The window that the shipped channel map names.
    replacements.push(("window: auto ", "window: {start: 10 s, end: 110 s} "));
    let campaign = CampaignFile::shipped_with(&replacements);
    let own = recording_of(&run_into(&campaign.path, scratch.path()));
    let foreign = scratch.path().join("foreign.mcap");
    python("as_another_program.py", [&own, &foreign]);
    let map = mapper_tests::repository().join("examples/channels/gap_rig.yaml");
    let arguments = ["identify".as_ref(), foreign.as_os_str(), "--channels".as_ref(), map.as_os_str()];
    let flags = ["--method".as_ref(), "dynamic".as_ref(), "--json".as_ref()];
    let result = mapper(arguments.into_iter().chain(flags)).exits(0).json();
    let (ours, theirs) = (points_of(&own), result["points"].as_array().unwrap());
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        assert!(b["truth"].is_null() && b["target"].is_null());
        assert_eq!(a["eta"].is_null(), b["eta"].is_null());
        for key in ["eta", "h_w_m2k", "speed_corrected_rpm", "flow_corrected_kg_s", "pressure_ratio"] {
            if let (Some(a), Some(b)) = (a[key].as_f64(), b[key].as_f64()) {
                // The other program's steps begin two samples late, at the first new command of the ramp: two thousandths of the window.
                assert!((b / a - 1.0).abs() < 2e-3, "{key}: {a} and {b}");
            }
        }
    }
}

/// A table of the nominal machine's own map (docs/reference/model.md, closed form), which the campaign names in a folder of its own.
fn table_of_turbo_a() -> String {
    let mut table = "speed,flow,pressure ratio,efficiency\n".to_owned();
    for krpm in (50..=170).step_by(10).map(f64::from) {
        let (n, tip_m_s) = (krpm / 100.0, std::f64::consts::PI * 0.052 * krpm * 1e3 / 60.0);
        let zero_slope = (1.0 + 1.06 * tip_m_s * tip_m_s / (2.0 * 1005.0 * 298.0)).powf(3.5);
        let choke = 1.0 + 0.15 * (zero_slope - 1.0);
        let (surge_kg_s, choke_kg_s) = (0.0265 * n.powf(1.35), 0.052 + 0.058 * n.powf(1.25));
        for x in (0..=10).map(|i| f64::from(i) / 10.0) {
            let flow_kg_s = surge_kg_s + (choke_kg_s - surge_kg_s) * (1.0 - x.powf(2.2)).sqrt();
            let away = (flow_kg_s - surge_kg_s) / (choke_kg_s - surge_kg_s) - 0.42;
            let eta = (0.74 - 0.07 * (n - 1.05).powi(2)) * (1.0 - 0.9 * away * away);
            let pressure_ratio = choke + (zero_slope - choke) * x;
            table += &format!("{},{flow_kg_s},{pressure_ratio},{eta}\n", krpm * 1e3);
        }
    }
    table
}

/// The run directory keeps what its campaign names, so that it can be moved and identified again.
#[test]
fn a_run_with_its_own_map_is_identified_from_its_directory() {
    let map = ("map: closed_form", "map: {file: maps/mine.csv, reference: SAE}");
    let replacements: Vec<_> = SHORT_GRID.iter().copied().chain([map]).collect();
    let campaign = CampaignFile::shipped_with(&replacements);
    std::fs::create_dir(campaign.directory().join("maps")).unwrap();
    std::fs::write(campaign.directory().join("maps/mine.csv"), table_of_turbo_a()).unwrap();
    let out = campaign.runs();
    let arguments =
        ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    let result = mapper(arguments).exits(0).json();
    let elsewhere = scratch();
    let moved = elsewhere.path().join("moved");
    std::fs::rename(only_run(&out), &moved).unwrap();
    let again = mapper(["identify".as_ref(), moved.as_os_str(), "--json".as_ref()]).exits(0).json();
    assert_eq!(again["points"], result["points"]);
}

/// Equal seeds give equal bytes at any pace, where each sample is polled for itself. At full speed the simulator integrates in other steps: a
/// ten-thousandth of the range in the seconds of a jump, and the noise is the same.
#[test]
fn a_paced_run_has_equal_bytes_at_any_pace_and_equal_readings_at_full_speed() {
    let replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
    let recording = |pace: &[&str]| {
        let campaign = CampaignFile::shipped_with(&replacements);
        let runs = campaign.runs();
        let arguments = ["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), runs.as_os_str()];
        mapper(arguments.into_iter().chain(pace.iter().map(AsRef::as_ref))).exits(0);
        let path = only_run(&runs).join("recording.mcap");
        let read = read_recording(&path, &ChannelMap::native(), &ReadOptions::default()).unwrap();
        (std::fs::read(path).unwrap(), read.recording)
    };
    let (paced, of_paced) = recording(&["--pace", "5000"]);
    assert!(paced == recording(&["--pace", "20000"]).0, "the bytes depend on the pace");
    let (_, at_full_speed) = recording(&[]);
    for (channel, series) in &of_paced.series {
        let other = &at_full_speed.series[channel];
        let scale = series.values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        for (value, other) in series.values.iter().zip(&other.values) {
            assert!((value - other).abs() <= 1e-3 * scale, "{channel}: {value} and {other}");
        }
    }
}
