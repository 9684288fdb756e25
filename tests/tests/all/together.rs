//! Identification of finished recordings, single ones and several as one map.

use mapper_tests::{CampaignFile, Finished, SHORT_GRID, mapper, scratch, shared_run};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const SPEEDS: &str = "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]";
const OPENINGS: &str = "openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]";

fn run(campaign: &CampaignFile) -> PathBuf {
    shared_run(campaign).run
}

fn identify(recordings: &[&Path], more: &[&str]) -> Finished {
    let files = recordings.iter().map(|file| file.to_str().unwrap());
    mapper(["identify"].into_iter().chain(files).chain(more.iter().copied()))
}

fn targets<'a>(points: impl Iterator<Item = &'a Value>) -> BTreeSet<String> {
    points.map(|point| point["target"].to_string()).collect()
}

fn points(json: &Value) -> &Vec<Value> {
    json["points"].as_array().unwrap()
}

#[test]
fn a_recording_identified_again_gives_the_files_of_its_run() {
    let (run, scratch) = (run(&CampaignFile::shipped_with(SHORT_GRID)), scratch());
    let out = scratch.path().join("again");
    identify(&[&run], &["--out", out.to_str().unwrap()]).exits(0);
    for file in ["points.json", "map.csv", "map.json", "map.svg"] {
        let read = |folder: &Path| std::fs::read(folder.join(file)).unwrap();
        assert!(read(&out) == read(&run), "{file} differs");
    }
    let report = |folder: &Path| std::fs::read_to_string(folder.join("report.md")).unwrap();
    let points_of = |text: &str| text.split("## Points").nth(1).unwrap().to_owned();
    assert_eq!(points_of(&report(&out)), points_of(&report(&run)));
    // Existing files are never replaced.
    let refused = identify(&[&run], &["--out", out.to_str().unwrap()]).exits(1);
    assert!(refused.stderr.contains("points.json"), "{}", refused.stderr);
}

/// Two halves of a map with a line in common: each point is on the map once, places are those of each recording alone, and
/// intervals of points that share their law over both are not wider than with one alone.
#[test]
fn two_recordings_make_one_map() {
    let half = |speeds: &str| {
        let few = "openings: [0.5, 1.0, 2.0]";
        CampaignFile::shipped_with(&[
            (SPEEDS, speeds),
            (OPENINGS, few),
            ("order: thermal_gradient ", "order: listed "),
            ("dwell: 40 s ", "dwell: 60 s "),
        ])
    };
    let (slow, fast) =
        (half("speeds: [50 krpm, 80 krpm, 110 krpm]"), half("speeds: [110 krpm, 140 krpm, 65 krpm]"));
    let (slow, fast) = (run(&slow), run(&fast));
    let scratch = scratch();
    let out = scratch.path().join("map");
    let together = identify(&[&slow, &fast], &["--json", "--out", out.to_str().unwrap()]).exits(0).json();
    assert_eq!(together["further_recordings"].as_array().unwrap().len(), 1);
    let map: Value = serde_json::from_slice(&std::fs::read(out.join("map.json")).unwrap()).unwrap();
    let on_map = |line: &Value| line["points"].as_array().unwrap().len();
    let counts: Vec<usize> = map["lines"].as_array().unwrap().iter().map(on_map).collect();
    assert_eq!(counts, [3; 5], "five lines of three points");

    let alone = [&slow, &fast].map(|run| identify(&[run], &["--json"]).exits(0).json());
    let new = |point: &&Value| point["kind"] == "point";
    assert_eq!(
        targets(points(&together).iter().filter(new)).len(),
        points(&together).iter().filter(new).count()
    );
    assert_eq!(targets(points(&together).iter()), targets(alone.iter().flat_map(points)), "no point is lost");
    let places = |points: &[Value]| -> Vec<[f64; 3]> {
        let place = |point: &Value| {
            ["flow_corrected_kg_s", "pressure_ratio", "speed_corrected_rpm"]
                .map(|key| point[key].as_f64().unwrap())
        };
        points.iter().map(place).collect()
    };
    let first = points(&alone[0]).len();
    // The zero of the first recording is subtracted from both.
    assert_eq!(places(&points(&together)[..first]), places(points(&alone[0])));
    let width = |point: &Value| point["eta_high"].as_f64().unwrap() - point["eta_low"].as_f64().unwrap();
    let mean = |points: &[Value]| points.iter().map(width).sum::<f64>() / points.len() as f64;
    let (before, now) = (mean(points(&alone[0])), mean(&points(&together)[..first]));
    // A few percent for the weights of what may be off, which more steps move.
    assert!(now < 1.05 * before, "{now} and {before}");
    assert!(
        points(&together).iter().all(|point| !point["truth"].is_null()),
        "each is scored by its own recording"
    );
    let report = std::fs::read_to_string(out.join("report.md")).unwrap();
    assert!(report.contains(fast.to_str().unwrap()), "{report}");
}

#[test]
fn recordings_of_different_machines_are_refused() {
    let one = CampaignFile::shipped_with(SHORT_GRID);
    let rebuilt = ("  serial_number: TA-0001\n", "  serial_number: TA-0002\n");
    let other = CampaignFile::shipped_with(&SHORT_GRID.iter().copied().chain([rebuilt]).collect::<Vec<_>>());
    let (one, other) = (run(&one), run(&other));
    let refused = identify(&[&one, &other], &[]).exits(6);
    assert!(refused.stderr.contains("TA-0001") && refused.stderr.contains("TA-0002"), "{}", refused.stderr);
}
