//! Unattended rigs: a rig trip, a killed runner, two runners for one rig, a plan from an unknown author.
#![cfg(unix)]

use crate::interrupted::Running;
use mapper_core::{Channel, EventKind};
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_tests::{
    CampaignFile, Finished, SHORT_GRID, SINGLE_STEP_METHOD, mapper, mapper_command, only_run,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The shipped campaign on a short grid, with parts replaced.
fn short(more: &[(&str, &str)]) -> CampaignFile {
    let replacements: Vec<_> = SHORT_GRID.iter().chain(more).copied().collect();
    CampaignFile::shipped_with(&replacements)
}

/// `mapper` with locks and latches of its own.
fn with_states(campaign: &CampaignFile, arguments: &[&std::ffi::OsStr]) -> Command {
    let mut command = mapper_command(arguments.iter().copied());
    command.env("MAPPER_STATE_DIR", campaign.directory().join("states"));
    command
}

fn run_of(campaign: &CampaignFile, more: &[&str]) -> Command {
    let out = campaign.runs();
    let mut arguments: Vec<&std::ffi::OsStr> = vec!["run".as_ref(), campaign.path.as_os_str()];
    arguments.extend(["--json".as_ref(), "--out".as_ref(), out.as_os_str()]);
    arguments.extend(more.iter().map(std::ffi::OsStr::new));
    with_states(campaign, &arguments)
}

fn done(mut command: Command) -> Finished {
    command.output().unwrap().into()
}

fn kinds(recording: &Path) -> Vec<EventKind> {
    let report = read_recording(recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
    report.recording.events.iter().map(|event| event.kind).collect()
}

/// The lab cuts its own air at 120 krpm on the way to 125 krpm: the run ends there instead of recording a standing shaft, and a
/// rig that can be had but once stays latched until an operator confirms that it was inspected.
#[test]
fn a_rig_trip_ends_the_run_and_locks_the_rig() {
    let campaign = short(&[("  virtual_lab: {}", "  virtual_lab: {trip_speed: 120 krpm, rig: bench}")]);
    let finished = done(run_of(&campaign, &[])).exits(5);
    assert!(finished.stderr.contains("the rig has tripped by itself"), "{}", finished.stderr);
    let recording = only_run(&campaign.runs()).join("recording.mcap");
    let kinds = kinds(&recording);
    // On the way down the lab says that it is slower again.
    let place = |kind| kinds.iter().position(|seen| *seen == kind);
    let (tripped, safe) = (place(EventKind::GuardTripped), place(EventKind::SafeState));
    assert!(tripped.is_some() && tripped < safe && safe == Some(kinds.len() - 1), "{kinds:?}");
    let report = read_recording(&recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
    let speed = &report.recording.series[&Channel::ShaftSpeed];
    let tripped_s =
        report.recording.events.iter().find(|event| event.kind == EventKind::RigTripped).unwrap().t_s;
    let events = report.recording.events.iter();
    let of_trip = |kind| events.clone().find(|event| event.kind == kind).unwrap().message.clone();
    assert_ne!(
        of_trip(EventKind::RigTripped),
        of_trip(EventKind::GuardTripped),
        "the reason is reported once"
    );
    // A poll of a second, the way down and the five seconds that are watched.
    assert!(speed.t_s.last().unwrap() - tripped_s < 1.0 + 20.0 + 5.1);

    let refused = done(run_of(&campaign, &[])).exits(5);
    assert!(refused.stderr.contains("mapper rig acknowledge bench"), "{}", refused.stderr);
    assert_eq!(campaign.runs().read_dir().unwrap().count(), 1, "a refused run leaves nothing");
    let status =
        done(with_states(&campaign, &["rig", "status", "bench", "--json"].map(AsRef::as_ref))).exits(0);
    assert!(status.json()["latch"]["reason"].as_str().unwrap().contains("overspeed"), "{}", status.stdout);
    done(with_states(&campaign, &["rig", "acknowledge", "bench"].map(AsRef::as_ref))).exits(0);
    let again = done(run_of(&campaign, &[])).exits(5);
    assert!(again.stderr.contains("the rig has tripped by itself"), "{}", again.stderr);
}

/// A rig declares its required guards; a campaign in which such a guard only notes is refused before the rig is touched.
#[test]
fn a_rig_without_its_guards_is_refused() {
    let campaign = short(&[("seed: 1 ", "guards: {overspeed: {reaction: note}}\nseed: 1 ")]);
    let refused = done(run_of(&campaign, &[])).exits(5);
    assert!(refused.stderr.contains("`overspeed`"), "{}", refused.stderr);
    assert!(!campaign.runs().exists());
    // A guard above the limit is a mistake with its position.
    let campaign = short(&[("seed: 1 ", "guards: {overspeed: {above: 200 krpm}}\nseed: 1 ")]);
    let wrong = done(run_of(&campaign, &[])).exits(3);
    assert!(wrong.stderr.contains("must not be looser") && wrong.stderr.contains('^'), "{}", wrong.stderr);
}

/// A run at fifty times the clock, in its soak of half an hour.
fn soaking(campaign: &CampaignFile) -> (Running, PathBuf) {
    let mut running = Running::start_with(campaign, &["--pace", "50"]);
    // More than its header: the rig is armed.
    let recording = running.wait_for_recording(80_000);
    (running, recording)
}

#[test]
fn a_rig_accepts_one_runner_and_is_locked_after_a_kill() {
    let campaign = short(&[("  virtual_lab: {}", "  virtual_lab: {rig: bench}")]);
    let (first, recording) = soaking(&campaign);
    let second = done(run_of(&campaign, &[])).exits(5);
    assert!(second.stderr.contains(&format!("in use by process {}", first.id())), "{}", second.stderr);
    first.kill();
    let stale = done(run_of(&campaign, &[])).exits(5);
    let run = recording.parent().unwrap();
    assert!(stale.stderr.contains(&format!("mapper run --resume {}", run.display())), "{}", stale.stderr);
    // Killed in its soak: all of it is made, with a soak, and the rig is free afterwards.
    let resumed = ["run".as_ref(), "--resume".as_ref(), run.as_os_str(), "--json".as_ref()];
    let result = done(with_states(&campaign, &resumed)).exits(0).json();
    assert_eq!(points(&result).len(), 4);
    done(run_of(&campaign, &[])).exits(0);
}

/// Every signal that would end the process, and Ctrl-C in the soak, which has no step to end: safe, in order, and now. A terminal's
/// Ctrl-Z does not leave the rig without guards.
#[test]
fn signals_make_the_rig_safe() {
    for signal in ["HUP", "TERM", "INT", "PWR", "RTMIN", "XFSZ"] {
        let campaign = short(&[]);
        let (mut running, recording) = soaking(&campaign);
        if signal == "TERM" {
            running.signal("TSTP");
            running.signal("TTOU");
            running.wait_for_recording(recording.metadata().unwrap().len() + 100_000);
        }
        running.signal(signal);
        let finished = running.wait().exits(130);
        assert!(finished.stderr.contains("stopped by the operator"), "{signal}: {}", finished.stderr);
        let kinds = kinds(&recording);
        assert_eq!(kinds, [EventKind::SoakStarted, EventKind::Interrupted, EventKind::SafeState], "{signal}");
    }
}

fn points(result: &Value) -> Vec<&Value> {
    let points = result["points"].as_array().unwrap();
    points.iter().filter(|point| point["kind"] == "point").collect()
}

/// The directory of a run that was killed when its recording had so many bytes.
fn killed_at(campaign: &CampaignFile, bytes: u64) -> PathBuf {
    let mut running = Running::start_with(campaign, &[]);
    let recording = running.wait_for_recording(bytes);
    running.kill();
    recording.parent().unwrap().to_owned()
}

/// Killed at several places of its steps and resumed, a run has each point once, and each as the uninterrupted run has it:
/// within four of its standard errors, since warm-up and lead-in draw other noise.
#[test]
fn a_killed_run_is_resumed_with_each_point_once() {
    let campaign = || {
        let slow: Vec<_> =
            SINGLE_STEP_METHOD.iter().copied().chain([("dwell: 120 s ", "dwell: 300 s ")]).collect();
        short(&slow)
    };
    let whole = done(run_of(&campaign(), &[])).exits(0).json();
    let expected = points(&whole);
    // A minute of warm-up and four steps of five, some 1.1 MB each.
    for bytes in [600_000, 1_900_000, 3_200_000] {
        let campaign = campaign();
        let run = killed_at(&campaign, bytes);
        let before = run.join("recording.mcap").metadata().unwrap().len();
        let arguments = ["run".as_ref(), "--resume".as_ref(), run.as_os_str(), "--json".as_ref()];
        let result = done(with_states(&campaign, &arguments)).exits(0).json();
        let found = points(&result);
        assert_eq!(found.len(), expected.len(), "killed at {bytes} bytes");
        assert_eq!(
            run.join("recording.mcap").metadata().unwrap().len(),
            before,
            "what was recorded is left alone"
        );
        for (found, expected) in found.iter().zip(&expected).skip(1) {
            assert_eq!((&found["target"], &found["valve"]), (&expected["target"], &expected["valve"]));
            let (eta, true_eta) = (found["eta"].as_f64().unwrap(), expected["eta"].as_f64().unwrap());
            let width = expected["eta_high"].as_f64().unwrap() - expected["eta_low"].as_f64().unwrap();
            assert!((eta - true_eta).abs() < width, "{eta} and {true_eta}, width {width}: {found}");
        }
        done(with_states(&campaign, &arguments)).exits(4);
        // The run is one thing for every command, and its newest results stand on top.
        let identified = mapper(["identify".as_ref(), run.as_os_str(), "--json".as_ref()]).exits(0).json();
        assert!(points(&identified) == found, "killed at {bytes} bytes");
        let on_top = std::fs::read_to_string(run.join("points.json")).unwrap();
        assert!(points(&serde_json::from_str(&on_top).unwrap()) == found);
    }
}

/// Recordings with equal readings are duplicates, whatever their file names, and even if one is cut.
#[test]
fn a_recording_that_is_given_twice_is_refused() {
    let campaign = short(&[]);
    let result = done(run_of(&campaign, &[])).exits(0).json();
    let recording = PathBuf::from(result["recording"].as_str().unwrap());
    let run = recording.parent().unwrap();
    let copy = run.join("copy.mcap");
    let bytes = std::fs::read(&recording).unwrap();
    std::fs::write(&copy, &bytes[..bytes.len() / 10 * 9]).unwrap();
    for command in ["identify", "drift"] {
        mapper([command.as_ref(), run.as_os_str(), copy.as_os_str()]).exits(3);
    }
    let path = campaign.path.as_os_str();
    mapper(["gap".as_ref(), "diagnose".as_ref(), path, run.as_os_str(), copy.as_os_str()]).exits(3);
}

#[test]
fn another_campaign_is_not_resumed() {
    let campaign = short(&[]);
    let run = killed_at(&campaign, 1_000_000);
    let other = short(&[("seed: 1 ", "seed: 2 ")]);
    let arguments = ["run".as_ref(), other.path.as_os_str(), "--resume".as_ref(), run.as_os_str()];
    let refused = done(with_states(&campaign, &arguments)).exits(4);
    assert!(refused.stderr.contains("the campaign"), "{}", refused.stderr);
    let nothing = campaign.directory().to_owned();
    let arguments = ["run".as_ref(), "--resume".as_ref(), nothing.as_os_str()];
    assert!(!with_states(&campaign, &arguments).output().unwrap().status.success());
}

/// A plan is a file from an unknown author: forbidden contents are refused before the rig is touched.
#[test]
fn hostile_plans_are_refused() {
    let campaign = short(&[]);
    let made = mapper(["plan".as_ref(), campaign.path.as_os_str(), "--json".as_ref()]).exits(0).json();
    let file = campaign.directory().join("plan.json");
    type Change = fn(&mut Value);
    let hostile: [(&str, Change, &str); 12] = [
        ("dwell without end", |plan| plan["steps"][1]["dwell_s"] = json!(1e300), "dwell"),
        ("no dwell", |plan| plan["steps"][1]["dwell_s"] = json!(0.0), "dwell"),
        ("negative warm-up", |plan| plan["warm_up_s"] = json!(-1.0), "warm-up"),
        ("cool-down without end", |plan| plan["cool_down_s"] = json!(1e12), "cool-down"),
        ("burst", |plan| plan["steps"][2]["speed_rpm"] = json!(400e3), "speed"),
        ("pressure", |plan| plan["steps"][2]["p3_pa"] = json!(900e3), "P3"),
        ("negative pressure", |plan| plan["steps"][2]["p3_pa"] = json!(-1.0), "P3"),
        ("fire", |plan| plan["steps"][0]["t3_k"] = json!(1300.0), "T3"),
        ("valve", |plan| plan["steps"][0]["valve"] = json!(0.0), "valve opening"),
        ("oil", |plan| plan["steps"][0]["oil_temperature_k"] = json!(0.0), "T_oil"),
        ("order", |plan| plan["steps"][0]["step"] = json!(7), "has the number 7"),
        ("nothing to do", |plan| plan["steps"] = json!([]), "0 steps"),
    ];
    for (what, change, words) in hostile {
        let mut plan = made.clone();
        change(&mut plan);
        std::fs::write(&file, plan.to_string()).unwrap();
        let refused = done(run_of(&campaign, &["--plan", file.to_str().unwrap()])).exits(4);
        assert!(refused.stderr.contains(words), "{what}: {}", refused.stderr);
        assert!(refused.stderr.len() < 400, "{what}: too long to be read: {}", refused.stderr);
    }
    let many = Value::Array(vec![made["steps"][0].clone(); 20_001]);
    let mut plan = made.clone();
    plan["steps"] = many;
    std::fs::write(&file, plan.to_string()).unwrap();
    assert!(
        done(run_of(&campaign, &["--plan", file.to_str().unwrap()])).exits(4).stderr.contains("20001 steps")
    );
    for text in ["", "{", "[]", "null", "{\"steps\": 1}", &"[".repeat(100_000)] {
        std::fs::write(&file, text).unwrap();
        done(run_of(&campaign, &["--plan", file.to_str().unwrap()])).exits(4);
    }
    assert!(!campaign.runs().exists(), "nothing was run");
}
