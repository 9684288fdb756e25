//! Shipped campaigns on the virtual lab without any effect: their diagnosis is within tolerance. `benches/shipped.py` has all of them with
//! all points, and twenty seeds of each.

use mapper_tests::{CampaignFile, mapper, repository, shared_run};
use std::path::Path;

fn assert_no_finding(campaign: &str, fewer: &[(&str, &str)]) {
    let shipped = repository().join("campaigns").join(campaign).with_extension("yaml");
    let shipped = std::fs::read_to_string(shipped).unwrap();
    let text = fewer.iter().fold(shipped, |text, (from, to)| {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text.replace(from, to)
    });
    let file = CampaignFile::of(text);
    let recording = shared_run(&file).result["recording"].as_str().unwrap().to_owned();
    let arguments = ["gap", "diagnose", file.path.to_str().unwrap(), &recording, "--json"];
    let diagnosis = mapper(arguments.map(Path::new)).exits(0).json();
    assert_eq!(diagnosis["verdict"], "within_tolerance", "{campaign}: {}", diagnosis["candidates"][0]);
}

#[test]
fn a_fault_free_gap_rig_has_no_finding() {
    assert_no_finding("gap_rig", &[]);
}

#[test]
fn a_fault_free_turbo_a_has_no_finding() {
    assert_no_finding(
        "turbo_a",
        &[
            (
                "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
                "speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm]",
            ),
            ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0, 2.0]"),
        ],
    );
}
