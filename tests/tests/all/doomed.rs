//! Campaigns that cannot succeed are reported before the night, not after it.

use crate::shipped_campaign::reports_the_time_of;
use mapper_tests::{CampaignFile, SHORT_GRID, mapper};

/// The shipped campaign on a short grid, with parts replaced.
fn short(more: &[(&str, &str)]) -> CampaignFile {
    let replacements: Vec<_> = SHORT_GRID.iter().chain(more).copied().collect();
    CampaignFile::shipped_with(&replacements)
}

/// A warning appears on standard error with its line and a caret; the campaign can still be run.
#[test]
fn check_warns_of_a_campaign_with_few_good_points() {
    for (old, new, at, message) in [
        ("soak: 30 min", "soak: 5 min", "5 min", "after a soak of 5 min, housings that were 3 K warmer"),
        (
            "probe_diameter: 0 mm",
            "probe_diameter: 15 mm",
            "15 mm",
            "probe of 15.00 mm has a time constant of",
        ),
    ] {
        let campaign = short(&[(old, new)]);
        let checked = mapper(["check".as_ref(), campaign.path.as_os_str()]).exits(0);
        assert!(checked.mentions(message), "{}", checked.stderr);
        assert!(checked.stdout.contains("no mistakes, "), "{}", checked.stdout);
        let lines: Vec<&str> = checked.stderr.lines().collect();
        let shown = format!("{} |", campaign.line_of(new));
        let line = lines.iter().position(|line| line.trim_start().starts_with(&shown)).unwrap();
        assert_eq!(lines[line + 1].find('^'), lines[line].find(at), "{}", checked.stderr);
        let json = mapper(["check".as_ref(), campaign.path.as_os_str(), "--json".as_ref()]).exits(0).json();
        let found = json["warnings"].as_array().unwrap();
        assert!(found.iter().any(|found| found["message"].as_str().unwrap().contains(message)), "{json}");
        assert_eq!(json["findings"].as_array().unwrap().len(), 0);
    }
}

/// The same for a campaign with a script; `shipped_campaign.rs` has the planned one.
#[test]
fn check_and_plan_report_the_same_time() {
    let campaign = "campaigns/turbo_a_adiabatic.yaml";
    let checked = mapper(["check", campaign, "--json"]).exits(0).json();
    let plan = mapper(["plan", campaign, "--json"]).exits(0).json();
    reports_the_time_of(&checked, &plan, plan["soak_s"].as_f64().unwrap() / 60.0);
}
