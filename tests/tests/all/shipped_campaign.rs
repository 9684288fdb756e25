//! The main job: the shipped campaign, from the file to the map.

use mapper_core::EventKind;
use mapper_recording::{ReadOptions, read_marks};
use mapper_tests::{CampaignFile, SHIPPED, SharedRun, mapper, repository, shared_run};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

fn shipped() -> SharedRun {
    shared_run(&CampaignFile::shipped_with(&[]))
}

/// Keys that scripts rely on, of the one object that `mapper run --json` prints.
const RUN_KEYS: &[&str] = &["run", "recording", "points", "map"];
const POINT_KEYS: &[&str] = &[
    "speed_rpm",
    "valve",
    "flow_corrected_kg_s",
    "speed_corrected_rpm",
    "pressure_ratio",
    "eta",
    "eta_low",
    "eta_high",
    "h_w_m2k",
    "h_low_w_m2k",
    "h_high_w_m2k",
    "method",
    "verdict",
    "truth",
];

#[test]
fn the_shipped_campaign_gives_a_map() {
    let SharedRun { run, result, stderr } = shipped();
    assert_eq!(stderr, "", "a run into a pipe is quiet");
    for key in RUN_KEYS {
        assert!(!result[key].is_null(), "{key}");
    }
    assert_eq!(result["run"], run.to_str().unwrap());
    assert!(Path::new(result["recording"].as_str().unwrap()).is_file());
    for format in ["csv", "json", "svg"] {
        let path = Path::new(result["map"][format].as_str().unwrap_or_else(|| panic!("no {format} map")));
        assert!(path.starts_with(&run) && path.metadata().unwrap().len() > 0, "{}", path.display());
    }
    let of_kind = |kind: &str| -> Vec<Value> {
        result["points"].as_array().unwrap().iter().filter(|point| point["kind"] == kind).cloned().collect()
    };
    let (points, repeats, again) = (of_kind("point"), of_kind("repeat"), of_kind("return"));
    assert_points_are_a_map(&points);
    // The first point, which no jump leads to, once more at the end.
    let [again] = again.as_slice() else { panic!("{} steps lead back to the first point", again.len()) };
    assert_eq!(again["target"], points[0]["target"]);
    assert_repeats_show_drift_and_are_not_in_the_map(&result, &points, &repeats);
}

/// Sections 4 and 5 of the paper: its points lie between surge and choke at up to 150 krpm.
#[test]
fn the_paper_s_machine_is_mapped_without_surge_or_overspeed() {
    let text = std::fs::read_to_string(repository().join("campaigns/turbo_paper.yaml")).unwrap();
    let SharedRun { run, result, .. } = shared_run(&CampaignFile::of(text));
    let (steps, events) = read_marks(&run.join("recording.mcap"), &ReadOptions::default()).unwrap();
    let troubles: Vec<_> = events
        .iter()
        .filter(|event| {
            let kinds = [EventKind::SurgeEntered, EventKind::OverspeedEntered, EventKind::GuardTripped];
            kinds.contains(&event.kind)
        })
        .collect();
    assert!(troubles.is_empty(), "{troubles:?}");
    assert!(steps.len() > 48 && result["points"].as_array().unwrap().len() == steps.len(), "{}", steps.len());
}

/// One jump, made at least twice where the campaign says nothing else. The virtual lab does not drift: what changes from
/// the first to the last is noise (4 standard errors: once in 16 000 seeds) and the housing that comes from elsewhere,
/// which moves what the method makes of a moving flow by some tenths of a point.
fn assert_repeats_show_drift_and_are_not_in_the_map(result: &Value, points: &[Value], repeats: &[Value]) {
    assert!(repeats.len() >= 2, "{} repeats", repeats.len());
    let jumps = result["repeats"].as_array().unwrap();
    assert!(!jumps.is_empty());
    for jump in jumps {
        assert!(jump["steps"].as_array().unwrap().len() >= 2, "{jump}");
        let [change, error] =
            ["eta_change", "eta_change_standard_error"].map(|key| jump[key].as_f64().unwrap());
        assert!(change.abs() < 4.0 * error + 0.004, "{jump}");
    }
    let map = std::fs::read_to_string(result["map"]["json"].as_str().unwrap()).unwrap();
    let map: Value = serde_json::from_str(&map).unwrap();
    let steps: BTreeSet<u64> = map["lines"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|line| line["points"].as_array().unwrap())
        .map(|point| point["identified"]["step"].as_u64().unwrap())
        .collect();
    // A repeat may stand for the first point, which no jump leads to.
    assert_eq!(steps.len(), points.len());
    let measured: BTreeSet<u64> = points.iter().map(|point| point["step"].as_u64().unwrap()).collect();
    assert!(steps.difference(&measured).count() <= 1);
    assert!(!result["repeats"].as_array().unwrap().is_empty());
}

fn assert_points_are_a_map(points: &[Value]) {
    assert!(points.len() >= 30, "{} points", points.len());
    for point in points {
        for key in POINT_KEYS {
            assert!(point.get(key).is_some(), "{key} in {point}");
        }
        assert!(["good", "doubtful", "unusable"].contains(&point["verdict"].as_str().unwrap()));
        if point["verdict"] == "good" {
            let [low, eta, high] = ["eta_low", "eta", "eta_high"].map(|key| point[key].as_f64().unwrap());
            assert!(0.0 < low && low < eta && eta < high && high < 1.0, "{point}");
            let [low, h, high] =
                ["h_low_w_m2k", "h_w_m2k", "h_high_w_m2k"].map(|key| point[key].as_f64().unwrap());
            assert!(low < h && h < high, "{point}");
        }
        let truth = &point["truth"];
        assert!(truth["eta"].is_f64() && truth["h_w_m2k"].is_f64(), "{point}");
    }
    let lines: BTreeSet<i64> =
        points.iter().map(|point| point["target"]["speed_rpm"].as_f64().unwrap() as i64).collect();
    assert!(lines.len() >= 6, "speed lines {lines:?}");
    assert_good_points_match_the_truth(points);
    assert_lines_go_from_surge_to_choke(points, &lines);
}

/// The points that the program vouches for are enough for a map.
fn assert_good_points_match_the_truth(points: &[Value]) {
    let good = points.iter().filter(|point| point["verdict"] == "good").count();
    assert!(good >= 30, "{good} of {} points are good", points.len());
}

/// Wider open means more flow at less pressure; by MODEL.md's map, choke has at least 1.7 times the flow of surge.
fn assert_lines_go_from_surge_to_choke(points: &[Value], lines: &BTreeSet<i64>) {
    for line in lines {
        let mut of_line: Vec<[f64; 3]> = points
            .iter()
            .filter(|point| point["target"]["speed_rpm"].as_f64().unwrap() as i64 == *line)
            .map(|point| {
                ["valve", "flow_corrected_kg_s", "pressure_ratio"].map(|key| point[key].as_f64().unwrap())
            })
            .collect();
        of_line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert!(of_line.len() >= 5, "{line} rpm has {} points", of_line.len());
        for pair in of_line.windows(2) {
            assert!(pair[0][1] < pair[1][1] && pair[0][2] > pair[1][2], "{line} rpm: {pair:?}");
        }
        let (first, last) = (of_line.first().unwrap(), of_line.last().unwrap());
        assert!(last[1] > 1.5 * first[1], "{line} rpm: flow from {} to {} kg/s", first[1], last[1]);
    }
}

#[test]
fn identification_of_the_run_directory_gives_the_points_of_the_run() {
    let SharedRun { run, result: of_run, .. } = shipped();
    let of_directory = mapper(["identify".as_ref(), run.as_os_str(), "--json".as_ref()]).exits(0).json();
    assert_eq!(of_directory["points"], of_run["points"]);
    let file = run.join("recording.mcap");
    let of_file = mapper(["identify".as_ref(), file.as_os_str(), "--json".as_ref()]).exits(0).json();
    assert_eq!(of_file["points"], of_run["points"]);
}

/// One time, however it is asked for: soak, warm-up, repeats and the way back included. The plan is the one that the run made.
#[test]
fn check_reports_the_time_of_the_plan_without_warnings() {
    let checked = mapper(["check", SHIPPED, "--json"]).exits(0).json();
    let plan = std::fs::read_to_string(shipped().run.join("plan.json")).unwrap();
    // A stored plan begins behind the soak, which is the campaign's.
    reports_the_time_of(&checked, &serde_json::from_str(&plan).unwrap(), 30.0);
}

/// What `mapper check --json` says of a campaign is what its plan and its soak say, without a warning.
pub(crate) fn reports_the_time_of(checked: &Value, plan: &Value, soak_min: f64) {
    let planned_min = soak_min + plan["figures"]["minutes"].as_f64().unwrap();
    let minutes = checked["minutes"].as_f64().unwrap();
    assert!((minutes - planned_min).abs() < 1e-6, "{minutes} min and {planned_min} min");
    assert_eq!(checked["steps"].as_u64().unwrap() as usize, plan["steps"].as_array().unwrap().len());
    assert_eq!(checked["warnings"].as_array().unwrap().len(), 0, "{checked}");
}
