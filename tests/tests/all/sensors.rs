//! Several sensors of a channel, from the campaign's list to the points.

use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_tests::{CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper, python, scratch};
use serde_json::Value;
use std::path::Path;

const SINGLE: &str = "  T2:    {noise: 0.1 K, offset: 0.25 K, gain: 0.05 %, probe_diameter: 0 mm}   # 0 mm: a probe without inertia\n";

/// Four points of the shipped campaign with these sensors of T2 and these settings of the lab.
fn campaign(sensors: &str, lab: &str) -> CampaignFile {
    let (sensors, lab) = (format!("  T2: {sensors}\n"), format!("  virtual_lab: {lab}\n"));
    // alpha_A known for certain: the remaining bias is the sensors'.
    let own = [
        (SINGLE, sensors.as_str()),
        ("  virtual_lab: {}\n", lab.as_str()),
        ("  alpha_area: 0       #", "  alpha_area_sigma: 0\n  alpha_area: 0       #"),
    ];
    CampaignFile::shipped_with(
        &SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).chain(&own).copied().collect::<Vec<_>>(),
    )
}

fn run(campaign: &CampaignFile, out: &Path) -> Value {
    let arguments =
        ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    mapper(arguments).exits(0).json()
}

const FOUR: &str = "{noise: 0.1 K, offset: 0.25 K, gain: 0.05 %, count: 4}";

#[test]
fn every_command_detects_and_excludes_a_faulty_thermocouple() {
    let scratch = scratch();
    let campaign = campaign(FOUR, "{faults: [{channel: T2, element: 3, offset: 2 K}]}");
    let checked = mapper(["check".as_ref(), campaign.path.as_os_str()]).exits(0);
    assert!(checked.stdout.contains("T2: 4 of 4 sensors"), "{}", checked.stdout);
    let result = run(&campaign, scratch.path());
    let [fused] = result["sensors"].as_array().unwrap().as_slice() else { panic!("{}", result["sensors"]) };
    let [out] = fused["left_out"].as_array().unwrap().as_slice() else { panic!("{fused}") };
    assert_eq!((&out["element"], &out["name"]), (&"T2/3".into(), &"T2/3".into()));
    // 2 K minus the mean of three draws of 0.25 K.
    assert_eq!(out["fault"]["kind"], "offset");
    let by = out["fault"]["size"].as_f64().unwrap();
    assert!((by - 2.0).abs() < 3.0 * 0.25 / 3f64.sqrt(), "{by} K");
    let report = std::fs::read_to_string(result["report"].as_str().unwrap()).unwrap();
    assert!(report.contains("T2/3"), "{report}");
    // The recording alone says the same again.
    let recording = result["recording"].as_str().unwrap();
    let again = mapper(["identify", recording, "--json"]).exits(0).json();
    assert_eq!(again["sensors"], result["sensors"]);
    assert_eq!(again["points"], result["points"]);
    let printed = mapper(["identify", recording]).exits(0).stdout;
    // Lines end anywhere.
    let words = printed.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("T2/3 reads") && words.contains("left out"), "{printed}");
}

/// What offsets add to the interval of each efficiency.
fn bias(result: &Value) -> Vec<f64> {
    let points = result["points"].as_array().unwrap().iter();
    points.filter_map(|point| point["eta_uncertainty"]["bias_standard_error"].as_f64()).collect()
}

#[test]
fn four_thermocouples_give_a_narrower_interval_than_one() {
    let scratch = scratch();
    let in_directory = |sensors: &str, name: &str| {
        let campaign = campaign(sensors, "{}");
        run(&campaign, &scratch.path().join(name))
    };
    let one = in_directory("{noise: 0.1 K, offset: 0.25 K, gain: 0.05 %, probe_diameter: 0 mm}", "one");
    let listed =
        in_directory("[{noise: 0.1 K, offset: 0.25 K, gain: 0.05 %, probe_diameter: 0 mm}]", "listed");
    let four = in_directory(FOUR, "four");
    assert_eq!(one["points"], listed["points"]);
    assert!(one.get("sensors").is_none(), "{}", one["sensors"]);
    let (one, four) = (bias(&one), bias(&four));
    assert!(!one.is_empty() && one.len() == four.len(), "{one:?} {four:?}");
    assert!(one.iter().zip(&four).all(|(one, four)| four < one), "{one:?} {four:?}");
}

#[test]
fn a_replayed_recording_carries_every_sensor() {
    let scratch = scratch();
    let first = run(&campaign(FOUR, "{}"), &scratch.path().join("first"));
    let recording = first["recording"].as_str().unwrap();
    let read = read_recording(Path::new(recording), &ChannelMap::native(), &ReadOptions::default()).unwrap();
    assert_eq!(read.recording.elements.len(), 4);
    let text = campaign(FOUR, "{}")
        .text
        .replace("  virtual_lab: {}\n", &format!("  replay: {{recording: {recording}}}\n"));
    let replayed = run(&CampaignFile::of(text), &scratch.path().join("second"));
    assert_eq!(replayed["sensors"], first["sensors"]);
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn an_independent_reader_sees_every_sensor() {
    let scratch = scratch();
    let result = run(&campaign(FOUR, "{}"), scratch.path());
    let recording = Path::new(result["recording"].as_str().unwrap());
    let theirs = python("columns.py", [recording]);
    let ours = read_recording(recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
    assert_eq!(ours.recording.elements.len(), 4);
    for (element, series) in &ours.recording.elements {
        let column = theirs["/rig/elements"][element.field()].as_array().unwrap();
        let values: Vec<f64> = column.iter().map(|value| value.as_f64().unwrap()).collect();
        // To the last bit: both read the shortest text of a number.
        assert_eq!(series.values, values, "{element}");
    }
}
