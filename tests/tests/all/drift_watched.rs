//! `on_drift`: what a run does when a repeat differs, and the soak that zeroes its sensors in plan and dry run.

use mapper_tests::{CampaignFile, DriftCampaign, Finished, mapper, scratch};
use serde_json::Value;
use std::path::Path;

/// Three speeds at three openings, and the jump again and again; T2 steps by ten times what is declared of it.
fn campaign(more: &str, drift: &str) -> CampaignFile {
    let every = 4;
    let speeds = "[90 krpm, 130 krpm, 70 krpm]";
    // The watch knows no model: a cell that wanders beyond what is declared of the sensors would be drift to it.
    let replaced = &[("    weather: wandering\n", "    weather: calm\n")];
    DriftCampaign { drift, speeds, every, more, replaced, ..DriftCampaign::default() }.write()
}

const STEP: &str = "{cause: T2, change: 4 K, from: 9 min}";

fn run(campaign: &CampaignFile, out: &Path, more: &[&str]) -> Finished {
    let arguments = ["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), out.as_os_str()];
    mapper(arguments.into_iter().chain(more.iter().map(|flag| flag.as_ref())))
}

#[test]
fn a_drift_ends_the_run_that_has_to_hold() {
    // The other settings, and runs without drift: `crates/runner/tests/drift_watch.rs`.
    let (scratch, campaign) = (scratch(), campaign("drift: {on_drift: hold}\n", STEP));
    let plan = mapper(["plan".as_ref(), campaign.path.as_os_str(), "--json".as_ref()]).exits(0).json();
    let result = run(&campaign, scratch.path(), &["--json"]).exits(5).json();
    let [planned, held] = [&plan["steps"], &result["points"]].map(|all| all.as_array().unwrap().len());
    let why = &result["failure"]["message"];
    assert!(0 < held && held < planned && why.is_string(), "{held} steps of {planned}: {why}");
}

#[test]
fn plan_and_dry_run_show_the_soak() {
    let scratch = scratch();
    let minutes = |text: &str| {
        let line = text.lines().find(|line| line.starts_with("rig time")).unwrap_or_else(|| panic!("{text}"));
        line.to_owned()
    };
    let plan = |more: &str| {
        let campaign = campaign(more, "");
        let text = mapper(["plan".as_ref(), campaign.path.as_os_str()]).exits(0).stdout;
        let json = mapper(["plan".as_ref(), campaign.path.as_os_str(), "--json".as_ref()]).exits(0).json();
        let dry = run(&campaign, scratch.path(), &["--dry-run"]).exits(0).stdout;
        (minutes(&text), json["soak_s"].clone(), minutes(&dry))
    };
    let (without, no_soak, _) = plan("");
    assert!(!without.contains("soak") && no_soak == Value::Null, "{without}");
    let (with, soak_s, dry) = plan("zero: {soak: 30 min}\n");
    assert!(with.contains("soak 30 min"), "{with}");
    assert_eq!(soak_s, 1800.0);
    assert_eq!(with, dry);
}
