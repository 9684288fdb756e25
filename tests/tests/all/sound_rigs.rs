//! Shipped campaigns on the virtual lab without any effect: their diagnosis is within tolerance. `benches/shipped.py` has twenty seeds of each.

use mapper_tests::{CampaignFile, made_once, mapper, repository};
use std::path::Path;

fn assert_no_finding(campaign: &str) {
    let shipped = repository().join("campaigns").join(campaign).with_extension("yaml");
    let file = CampaignFile::of(std::fs::read_to_string(shipped).unwrap());
    let recording = made_once(&file).result["recording"].as_str().unwrap().to_owned();
    let arguments = ["gap", "diagnose", file.path.to_str().unwrap(), &recording, "--json"];
    let diagnosis = mapper(arguments.map(Path::new)).exits(0).json();
    assert_eq!(diagnosis["verdict"], "within_tolerance", "{campaign}: {}", diagnosis["candidates"][0]);
}

#[test]
fn a_fault_free_grid18_has_no_finding() {
    assert_no_finding("grid18");
}

#[test]
fn a_fault_free_gap_rig_has_no_finding() {
    assert_no_finding("gap_rig");
}

#[test]
fn a_fault_free_turbo_a_has_no_finding() {
    assert_no_finding("turbo_a");
}

#[test]
fn a_fault_free_turbo_a_lines_has_no_finding() {
    assert_no_finding("turbo_a_lines");
}
