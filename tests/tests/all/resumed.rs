//! Runs whose steps depend on what was measured, killed and gone on with: the source of the steps receives the recording again.
#![cfg(unix)]

use crate::interrupted::Running;
use mapper_tests::{CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper, only_run};
use serde_json::Value;
use std::io::Write;
use std::path::Path;

fn short(more: &[(&str, &str)]) -> CampaignFile {
    let replacements: Vec<_> = SHORT_GRID.iter().chain(more).copied().collect();
    CampaignFile::shipped_with(&replacements)
}

fn points(run: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(run.join("points.json")).unwrap();
    let found: Value = serde_json::from_str(&text).unwrap();
    let points = found["points"].as_array().unwrap().iter().filter(|point| point["kind"] == "point").cloned();
    let mut points: Vec<Value> = points.collect();
    points.sort_by_key(|point| (point["target"].to_string(), point["valve"].to_string()));
    points
}

/// Killed at two places of its recording and gone on with, the run has each point once, each as the uninterrupted run has it:
/// within the width of its interval, since warm-up and lead-in draw other noise.
fn assert_resumed(what: &str, campaign: impl Fn() -> CampaignFile) {
    let whole = campaign();
    let runs = whole.runs();
    let arguments = ["run".as_ref(), whole.path.as_os_str(), "--out".as_ref(), runs.as_os_str()];
    mapper(arguments).exits(0);
    let run = only_run(&runs);
    let expected = points(&run);
    let bytes = run.join("recording.mcap").metadata().unwrap().len();
    for share in [0.4, 0.75] {
        let campaign = campaign();
        let mut running = Running::start_with(&campaign, &[]);
        let recording = running.wait_for_recording((share * bytes as f64) as u64);
        running.kill();
        let run = recording.parent().unwrap();
        let arguments = ["run".as_ref(), "--resume".as_ref(), run.as_os_str()];
        mapper(arguments).exits(0);
        let found = points(run);
        assert_eq!(found.len(), expected.len(), "{what} at {share}");
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(found["target"], expected["target"], "{what} at {share}");
            let number = |point: &Value, key: &str| point[key].as_f64();
            let (Some(eta), Some(other)) = (number(found, "eta"), number(expected, "eta")) else { continue };
            let width = number(expected, "eta_high").unwrap() - number(expected, "eta_low").unwrap();
            assert!((eta - other).abs() < width, "{what} at {share}: {eta} and {other}, width {width}");
        }
    }
}

#[test]
fn a_killed_script_is_resumed_at_its_step() {
    assert_resumed("sequence", || {
        let replaced = ("seed: 1 ", "sequence: steps/along.rhai\nseed: 1 ");
        let campaign = short(&SINGLE_STEP_METHOD.iter().copied().chain([replaced]).collect::<Vec<_>>());
        let folder = campaign.directory().join("steps");
        std::fs::create_dir_all(&folder).unwrap();
        // What was measured decides how long the next one is visited.
        let script = "let last = ();\nfor p in grid() {\n    let seconds = if last == () { \"120 s\" } else { \"130 s\" };\n    \
                      last = jump(p, seconds).eta;\n}\n";
        std::fs::write(folder.join("along.rhai"), script).unwrap();
        campaign
    });
}

#[test]
fn a_killed_drift_watch_is_resumed_at_its_step() {
    let drift = ("repeats: off\n", "repeats: {every: 3}\ndrift: {on_drift: continue}\n");
    assert_resumed("drift", || short(&SINGLE_STEP_METHOD.iter().copied().chain([drift]).collect::<Vec<_>>()));
}

#[test]
fn a_killed_surge_search_restarts_its_line() {
    let search = ("seed: 1 ", "surge_search: {}\nseed: 1 ");
    assert_resumed("surge_search", || {
        short(&SINGLE_STEP_METHOD.iter().copied().chain([search]).collect::<Vec<_>>())
    });
}

/// A recording that is gone or cut to a half after two steps were saved: the run names the file and is resumed only with the option.
/// For a script, whose steps depend on what was measured, the lost steps are run again too.
#[test]
fn a_lost_recording_is_named_and_its_steps_are_run_again_only_if_told() {
    for (script, cut) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut replaced = SINGLE_STEP_METHOD.to_vec();
        if script {
            replaced.push(("seed: 1 ", "sequence: along.rhai\nseed: 1 "));
        }
        let campaign = short(&replaced);
        if script {
            std::fs::write(
                campaign.directory().join("along.rhai"),
                "for p in grid() { jump(p, \"120 s\"); }\n",
            )
            .unwrap();
        }
        let mut running = Running::start_with(&campaign, &["--pace", "200"]);
        let recording = running.wait_for_journal("{\"step_saved\":2}");
        running.kill();
        let run = recording.parent().unwrap();
        let bytes = recording.metadata().unwrap().len();
        if cut {
            let file = std::fs::OpenOptions::new().write(true).open(&recording).unwrap();
            file.set_len(bytes / 4).unwrap();
        } else {
            std::fs::remove_file(&recording).unwrap();
        }
        let resume = ["run".as_ref(), "--resume".as_ref(), run.as_os_str(), "--json".as_ref()];
        let refused = mapper(resume).exits(4);
        assert!(refused.stderr.contains("recording.mcap"), "{}", refused.stderr);
        assert!(!run.join("recording-2.mcap").exists());
        mapper(resume.iter().copied().chain(["--repeat-lost".as_ref()])).exits(0);
        assert_eq!(points(run).len(), 4, "script {script}, cut {cut}");
    }
}

/// A journal that names steps as recorded which the recording does not hold: the recording decides, and they are run.
#[test]
fn a_step_without_flushed_samples_is_run_again() {
    let campaign = || short(SINGLE_STEP_METHOD);
    let whole = campaign();
    let runs = whole.runs();
    mapper(["run".as_ref(), whole.path.as_os_str(), "--out".as_ref(), runs.as_os_str()]).exits(0);
    let run = only_run(&runs);
    let expected = points(&run);
    let bytes = run.join("recording.mcap").metadata().unwrap().len();
    // A part that a simulated rig repeated to the last bit, after a kill between the recording's end and the journal's, counts once.
    let journal = std::fs::read_to_string(run.join("journal.jsonl")).unwrap();
    std::fs::copy(run.join("recording.mcap"), run.join("recording-2.mcap")).unwrap();
    let twice = format!("{journal}{}", journal.replace("recording.mcap", "recording-2.mcap"));
    std::fs::write(run.join("journal.jsonl"), twice).unwrap();
    mapper(["identify".as_ref(), run.as_os_str(), "--out".as_ref(), runs.join("again").as_os_str()]).exits(0);
    assert_eq!(points(&runs.join("again")), expected);
    // A command that follows one recording does not take the first for the run, nor does any if the journal is gone.
    mapper(["transient".as_ref(), run.as_os_str()]).exits(3);
    std::fs::remove_file(run.join("journal.jsonl")).unwrap();
    mapper(["identify".as_ref(), run.as_os_str()]).exits(3);
    let campaign = campaign();
    let mut running = Running::start_with(&campaign, &[]);
    let recording = running.wait_for_recording((0.4 * bytes as f64) as u64);
    running.kill();
    let run = recording.parent().unwrap();
    let mut journal = std::fs::OpenOptions::new().append(true).open(run.join("journal.jsonl")).unwrap();
    for step in 1..=99 {
        writeln!(journal, "{{\"step_saved\":{step}}}").unwrap();
    }
    // A second part that ended before its first flush.
    let first =
        std::fs::read_to_string(run.join("journal.jsonl")).unwrap().lines().next().unwrap().to_owned();
    writeln!(journal, "{}", first.replace("recording.mcap", "recording-2.mcap")).unwrap();
    std::fs::write(run.join("recording-2.mcap"), "").unwrap();
    drop(journal);
    mapper(["identify".as_ref(), run.as_os_str()]).exits(0);
    // They are lost, and run again only if the operator says so.
    let resume = ["run".as_ref(), "--resume".as_ref(), run.as_os_str()];
    let refused = mapper(resume).exits(4);
    assert!(refused.stderr.contains("recording.mcap"), "{}", refused.stderr);
    mapper(resume.iter().copied().chain(["--repeat-lost".as_ref()])).exits(0);
    mapper(["identify".as_ref(), run.as_os_str()]).exits(0);
    let targets = |points: &[Value]| points.iter().map(|point| point["target"].clone()).collect::<Vec<_>>();
    assert_eq!(targets(&points(run)), targets(&expected));
}

/// A run that is going on has one runner.
#[test]
fn a_run_in_progress_is_not_resumed() {
    let campaign = CampaignFile::shipped_with(&[("dwell: 40 s ", "dwell: 10 min ")]);
    let mut running = Running::start_with(&campaign, &[]);
    let recording = running.wait_for_recording(1 << 20);
    let run = recording.parent().unwrap();
    mapper(["run".as_ref(), "--resume".as_ref(), run.as_os_str()]).exits(4);
    assert!(!run.join("recording-2.mcap").exists());
    running.kill();
}
