//! Campaigns whose steps come from a script.

use mapper_core::Channel;
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_tests::{CampaignFile, Finished, SHORT_GRID, SINGLE_STEP_METHOD, mapper, only_run, scratch};
use serde_json::Value;
use std::path::Path;

fn run_into(campaign: &Path, out: &Path) -> Finished {
    mapper(["run".as_ref(), campaign.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()])
}

/// The shipped campaign on a short grid, with a script next to it.
fn scripted(script: &str, more: &[(&str, &str)]) -> CampaignFile {
    let key = ("order: thermal_gradient ", "sequence: steps.rhai\norder: thermal_gradient ");
    let replacements: Vec<_> = SHORT_GRID.iter().chain(more).copied().chain([key]).collect();
    let campaign = CampaignFile::shipped_with(&replacements);
    std::fs::write(campaign.directory().join("steps.rhai"), script).unwrap();
    campaign
}

fn speeds(points: &Value) -> Vec<f64> {
    points
        .as_array()
        .unwrap()
        .iter()
        .map(|point| (point["speed_rpm"].as_f64().unwrap() / 1e3).round())
        .collect()
}

#[test]
fn every_example_is_planned_and_run() {
    for (name, steps, note) in [
        ("zigzag", 8..=8, ""),
        ("adaptive", 9..=40, "measuring"),
        ("drift_anchored", 12..=12, "points off the first"),
        ("hysteresis", 5..=5, "on the way down"),
        ("hot_restart", 5..=5, "colder a minute after the restart"),
        ("surge_by_variance", 4..=20, "surge is near"),
    ] {
        let scratch = scratch();
        let campaign = mapper_tests::repository().join(format!("examples/sequences/{name}.yaml"));
        let plan = mapper(["plan".as_ref(), campaign.as_os_str(), "--json".as_ref()]).exits(0).json();
        assert_eq!((&plan["objective"], &plan["forecast"]), (&"sequence".into(), &true.into()));
        assert!(plan["made_from"]["script_sha256"].is_string());
        let forecast = plan["steps"].as_array().unwrap();
        assert!(steps.contains(&forecast.len()), "{name}: {} steps", forecast.len());
        let result = run_into(&campaign, scratch.path()).exits(0).json();
        // The virtual lab of these campaigns is the nominal machine with the same seed: it goes as rehearsed.
        assert_eq!(result["points"].as_array().unwrap().len(), forecast.len(), "{name}");
        let run = only_run(scratch.path());
        let report = std::fs::read_to_string(run.join("report.md")).unwrap();
        assert!(report.contains(note), "{name}: {report}");
        assert!(run.join("sequence.rhai").is_file());
        let again = mapper(["identify".as_ref(), run.as_os_str(), "--json".as_ref()]).exits(0).json();
        assert_eq!(again["points"].as_array().unwrap().len(), forecast.len(), "{name}");
    }
}

/// An editor on Windows may begin a file with a byte order mark.
#[test]
fn a_script_may_begin_with_a_byte_order_mark() {
    let campaign = scripted("\u{feff}for p in grid() { jump(p); }", &[]);
    mapper(["plan".as_ref(), campaign.path.as_os_str()]).exits(0);
}

/// The script receives for each step what identification later finds in the whole recording.
#[test]
fn a_script_receives_the_results_of_the_recording() {
    let script = "for p in grid() { jump(p); }\nfor r in results() { note(`eta ${r.step} ${r.eta}`); }\n";
    let campaign = scripted(script, SINGLE_STEP_METHOD);
    let result = run_into(&campaign.path, &campaign.runs()).exits(0).json();
    let report = std::fs::read_to_string(only_run(&campaign.runs()).join("report.md")).unwrap();
    let points = result["points"].as_array().unwrap();
    assert_eq!(points.len(), 4);
    for point in points.iter().filter(|point| point["eta"].is_number()) {
        let step = point["step"].as_u64().unwrap();
        let mark = format!("eta {step} ");
        let received = report.split(&mark).nth(1).unwrap().split_whitespace().next().unwrap();
        let (received, eta): (f64, f64) = (received.parse().unwrap(), point["eta"].as_f64().unwrap());
        assert!((received - eta).abs() < 1e-9, "step {step}: {received} was received, {eta} is identified");
    }
}

#[test]
fn same_seed_same_bytes() {
    let script = "for p in order(grid()) { let r = jump(p); note(`${r}`); }";
    let campaign = scripted(script, &[]);
    let recordings: Vec<Vec<u8>> = (0..2)
        .map(|_| {
            let out = scratch();
            run_into(&campaign.path, out.path()).exits(0);
            std::fs::read(only_run(out.path()).join("recording.mcap")).unwrap()
        })
        .collect();
    assert!(recordings[0] == recordings[1]);
}

#[test]
fn a_script_that_fails_its_rehearsal_does_not_touch_the_rig() {
    let script =
        "for p in grid() {\n    let r = jump(p);\n    if elapsed_s() > 400.0 { throw \"enough\"; }\n}\n";
    let campaign = scripted(script, &[]);
    let failed = run_into(&campaign.path, &campaign.runs()).exits(3);
    assert!(
        failed.stderr.contains("steps.rhai:3:30") && failed.stderr.contains("enough"),
        "{}",
        failed.stderr
    );
    assert!(!campaign.runs().exists());
}

/// The lab's T2 probe is off by 30 K, which the nominal machine of the rehearsal knows nothing of.
#[test]
fn a_script_error_during_a_run_leaves_a_safe_rig_and_the_recording() {
    let script = "for p in grid() {\n    let r = jump(p);\n    if r.has_eta && r.eta < 0.55 { throw \"too low\"; }\n}\n";
    let campaign = scripted(script, &[("virtual_lab: {}", "virtual_lab: {offset_of: {T2: 30 K}}")]);
    let failed = run_into(&campaign.path, &campaign.runs()).exits(3);
    assert!(
        failed.stderr.contains("steps.rhai:3:36") && failed.stderr.contains("too low"),
        "{}",
        failed.stderr
    );
    let run = only_run(&campaign.runs());
    let again = mapper(["identify".as_ref(), run.as_os_str(), "--json".as_ref()]).exits(0).json();
    let points = again["points"].as_array().unwrap();
    assert!((2..4).contains(&points.len()), "{} steps were recorded", points.len());
    // What was recorded is there as a map and a report, and so are the steps that were made.
    let report = std::fs::read_to_string(run.join("report.md")).unwrap();
    assert!(report.contains("too low"), "{report}");
    assert!(run.join("map.json").is_file() && run.join("points.json").is_file());
    let executed = std::fs::read_to_string(run.join("executed_plan.json")).unwrap();
    let executed: Value = serde_json::from_str(&executed).unwrap();
    assert_eq!(executed["steps"].as_array().unwrap().len(), points.len());
    // After the last step the rig was made safe and watched for 5 s: no more is blown into the turbine.
    let read =
        read_recording(&run.join("recording.mcap"), &ChannelMap::native(), &ReadOptions::default()).unwrap();
    let last_s = read.recording.steps.last().unwrap().end_s;
    let pressure = &read.recording.series[&Channel::P3];
    let (end_s, end_pa) = (pressure.t_s.last().unwrap(), pressure.values.last().unwrap());
    assert!(*end_s >= last_s + 4.5, "{end_s} {last_s}");
    assert!(*end_pa < pressure.held(last_s).unwrap(), "{end_pa} Pa");
}

/// The lab's T2 probe reads 220 K too high: at the fast points beyond the limit that the guard watches.
#[test]
fn guards_apply_to_scripts() {
    let campaign = scripted(
        "for p in grid() { jump(p); }",
        &[("virtual_lab: {}", "virtual_lab: {offset_of: {T2: 220 K}}")],
    );
    let failed = run_into(&campaign.path, &campaign.runs()).exits(5);
    assert!(failed.stderr.contains("T2") && failed.stderr.contains("the rig is safe"), "{}", failed.stderr);
}

#[test]
fn a_step_beyond_the_limits_is_refused_at_its_line() {
    let campaign = scripted("jump(grid()[0]);\njump(point(\"190 krpm\", 1.0));\n", &[]);
    for command in ["plan", "run"] {
        let failed = mapper([command.as_ref(), campaign.path.as_os_str()]).exits(3);
        let expected = [
            "steps.rhai:2:1",
            "190 krpm",
            "above the speed limit, `limits.speed` = 180 krpm",
            "2 | jump(point(\"190 krpm\", 1.0));",
        ];
        assert!(expected.iter().all(|part| failed.stderr.contains(part)), "{}", failed.stderr);
    }
}

#[test]
fn a_missing_script_is_a_mistake_of_the_campaign() {
    let campaign = scripted("", &[]);
    std::fs::remove_file(campaign.directory().join("steps.rhai")).unwrap();
    let failed = mapper(["check".as_ref(), campaign.path.as_os_str()]).exits(3);
    let line = format!(":{}:", campaign.line_of("sequence: steps.rhai"));
    assert!(failed.stderr.contains(&line) && failed.stderr.contains("steps.rhai"), "{}", failed.stderr);
}

#[test]
fn a_stored_forecast_is_stale_when_its_script_changes() {
    let campaign = scripted("for p in grid() { jump(p); }", &[]);
    let stored = campaign.directory().join("plan.json");
    mapper(["plan".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), stored.as_os_str()]).exits(0);
    let run = |code| {
        let out = campaign.runs();
        let plan = ["run".as_ref(), campaign.path.as_os_str(), "--plan".as_ref(), stored.as_os_str()];
        mapper(plan.into_iter().chain(["--json".as_ref(), "--out".as_ref(), out.as_os_str()])).exits(code)
    };
    assert_eq!(speeds(&run(0).json()["points"]), [80.0, 125.0, 80.0, 125.0]);
    std::fs::write(campaign.directory().join("steps.rhai"), "jump(grid()[0]);").unwrap();
    let stale = run(4);
    assert!(stale.stderr.contains("the sequence script changed"), "{}", stale.stderr);
}

/// What a script sets of T3 and oil is what the virtual lab then has, behind its actuators' lags of 20 and 30 s, and speed is held.
#[test]
fn the_lab_follows_t3_and_oil_of_a_script() {
    let script = "let p = point(\"110 krpm\", 1.0);\njump(p, \"60 s\");\noil(\"85 degC\");\njump(p, \"200 s\");\nt3(\"400 degC\");\njump(p, \"200 s\");\n";
    let campaign = scripted(script, &[]);
    run_into(&campaign.path, &campaign.runs()).exits(0);
    let run = only_run(&campaign.runs());
    let read =
        read_recording(&run.join("recording.mcap"), &ChannelMap::native(), &ReadOptions::default()).unwrap();
    let recording = &read.recording;
    let at_end = |channel: Channel, step: usize| {
        let end_s = recording.steps[step].end_s;
        let series = &recording.series[&channel];
        let late = series.t_s.iter().zip(&series.values).filter(|(t, _)| (end_s - 5.0..end_s).contains(*t));
        let values: Vec<f64> = late.map(|(_, value)| *value).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let (oil_k, t3_k) = (273.15 + 85.0, 273.15 + 400.0);
    // Offsets of the sensors, and what a lag leaves after 200 s.
    for step in [1, 2] {
        assert!((at_end(Channel::TOil, step) - oil_k).abs() < 3.0, "{}", at_end(Channel::TOil, step));
    }
    assert!(at_end(Channel::TOil, 0) < oil_k - 10.0);
    assert!((at_end(Channel::T3, 2) - t3_k).abs() < 3.0, "{}", at_end(Channel::T3, 2));
    assert!(at_end(Channel::T3, 1) > t3_k + 50.0);
    for step in [0, 1, 2] {
        let speed_rpm = at_end(Channel::ShaftSpeed, step);
        assert!((speed_rpm / 110e3 - 1.0).abs() < 0.01, "{step}: {speed_rpm}");
    }
    // What no rig here accepts is refused before it is touched.
    let campaign = scripted("oil(\"190 degC\");\njump(point(\"110 krpm\", 1.0));\n", &[]);
    let refused = run_into(&campaign.path, &campaign.runs());
    assert!(!campaign.runs().exists() || std::fs::read_dir(campaign.runs()).unwrap().next().is_none());
    for part in ["463.15 K", "450 K", "steps.rhai:1:1"] {
        assert!(refused.stderr.contains(part), "{part}: {}", refused.stderr);
    }
}
