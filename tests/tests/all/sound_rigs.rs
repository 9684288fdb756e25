//! Shipped campaigns on the virtual lab without any effect: their diagnosis is within tolerance. `benches/shipped.py` has twenty seeds of each.

use mapper_tests::{CampaignFile, made_once, mapper, repository};
use std::path::Path;

fn nothing_is_wrong_with(campaign: &str) {
    let shipped = repository().join("campaigns").join(campaign).with_extension("yaml");
    let file = CampaignFile::of(std::fs::read_to_string(shipped).unwrap());
    let recording = made_once(&file).result["recording"].as_str().unwrap().to_owned();
    let arguments = ["gap", "diagnose", file.path.to_str().unwrap(), &recording, "--json"];
    let diagnosis = mapper(arguments.map(Path::new)).exits(0).json();
    assert_eq!(diagnosis["verdict"], "within_tolerance", "{campaign}: {}", diagnosis["candidates"][0]);
}

#[test]
fn nothing_is_wrong_with_grid18() {
    nothing_is_wrong_with("grid18");
}

#[test]
fn nothing_is_wrong_with_gap_rig() {
    nothing_is_wrong_with("gap_rig");
}

#[test]
fn nothing_is_wrong_with_turbo_a() {
    nothing_is_wrong_with("turbo_a");
}

#[test]
fn nothing_is_wrong_with_turbo_a_lines() {
    nothing_is_wrong_with("turbo_a_lines");
}
