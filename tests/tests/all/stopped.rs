//! Runs that an operator stops, and plans that no longer match their campaign.
#![cfg(unix)]

use crate::interrupted::Running;
use mapper_core::EventKind;
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, read_recording};
use mapper_tests::{CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper};
use std::path::Path;

fn short() -> CampaignFile {
    CampaignFile::shipped_with(&SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect::<Vec<_>>())
}

fn read(recording: &Path) -> ReadReport {
    read_recording(recording, &ChannelMap::native(), &ReadOptions::default()).unwrap()
}

/// Once at the end of the step, which is whole then; twice now, in the middle of one. At thirty times the clock a step takes four seconds.
#[test]
fn ctrl_c_ends_the_run_after_its_step_and_a_second_one_at_once() {
    for times in [1, 2] {
        let campaign = short();
        let mut running = Running::start_with(&campaign, &["--pace", "30", "--progress", "lines"]);
        // The warm-up is over: the first step is under way.
        let recording = running.wait_for_recording(400_000);
        running.signal("INT");
        if times == 2 {
            // Signals of one kind that wait are one: the first has to be seen.
            running.wait_for_output("stop requested");
            running.signal("INT");
        }
        running.wait().exits(130);
        let report = read(&recording);
        let kinds: Vec<EventKind> = report.recording.events.iter().map(|event| event.kind).collect();
        assert!(kinds.ends_with(&[EventKind::Interrupted, EventKind::SafeState]), "{kinds:?}");
        let last = report.recording.steps.last().unwrap();
        let whole = last.end_s - last.start_s > 119.0;
        assert_eq!(whole, times == 1, "{times} times: {last:?}");
    }
}

/// While it plans a run has touched nothing, and any signal ends it; no directory is left behind.
#[test]
fn a_signal_while_planning_ends_the_run_before_it_touches_the_rig() {
    for signal in ["INT", "TERM", "HUP"] {
        // Some seconds of planning.
        let speeds: Vec<String> = (0..60).map(|k| format!("{} krpm", 50 + k)).collect();
        let openings: Vec<String> = (0..30).map(|k| format!("{:.2}", 0.7 + 0.05 * f64::from(k))).collect();
        let (speeds, openings) =
            (format!("  speeds: [{}]", speeds.join(", ")), format!("  openings: [{}]", openings.join(", ")));
        let campaign = CampaignFile::shipped_with(&[
            (
                "  speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
                &speeds,
            ),
            ("  openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", &openings),
        ]);
        let running = Running::start_with(&campaign, &[]);
        running.wait_for_signal_handler();
        running.signal(signal);
        running.wait().exits(130);
        assert!(!campaign.runs().exists(), "{signal}: nothing was touched");
    }
}

/// A plan is only valid for its campaign.
#[test]
fn a_plan_of_an_edited_campaign_is_refused() {
    let campaign = short();
    let plan = campaign.directory().join("plan.json");
    mapper(["plan".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), plan.as_os_str()]).exits(0);
    let arguments = || {
        let out = campaign.runs();
        let first =
            ["run".into(), campaign.path.clone().into_os_string(), "--plan".into(), plan.clone().into()];
        first.into_iter().chain(["--out".into(), out.into_os_string()]).collect::<Vec<std::ffi::OsString>>()
    };
    let edited = campaign.text.replace("dwell: 120 s ", "dwell: 110 s ");
    assert_ne!(edited, campaign.text);
    std::fs::write(&campaign.path, edited).unwrap();
    let refused = mapper(arguments()).exits(4);
    assert!(refused.stderr.contains("is stale"), "{}", refused.stderr);
    assert!(!campaign.runs().exists(), "nothing was touched");
    std::fs::write(&campaign.path, &campaign.text).unwrap();
    mapper(arguments()).exits(0);
}
