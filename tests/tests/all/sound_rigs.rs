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

/// The faults that the check of sensors and actuators finds on the lab with these settings.
fn faults(settings: &[(&str, &str)]) -> Vec<serde_json::Value> {
    let fewer = [
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0, 2.0]"),
    ];
    let file = CampaignFile::shipped_with(&[settings, &fewer].concat());
    let run = shared_run(&file).result["run"].as_str().unwrap().to_owned();
    let points = std::fs::read_to_string(Path::new(&run).join("points.json")).unwrap();
    let points: serde_json::Value = serde_json::from_str(&points).unwrap();
    points["faults"].as_array().unwrap().clone()
}

/// Air and a valve that follow later than declared are named with the delay that the lab has, and no point depends on it.
#[test]
fn a_late_air_supply_and_a_late_valve_are_named_with_their_delays() {
    let lab = "virtual_lab: {effects: {slow_valve: 2 s, actuator_lag: 3 s}}";
    let faults = faults(&[("virtual_lab: {}", lab)]);
    for (name, delay_s) in [
        ("delay of P3 behind its command", 2.7),
        ("delay of the back-pressure valve behind its command", 2.0),
    ] {
        let fault = faults.iter().find(|fault| fault["fault"] == name);
        let fault = fault.unwrap_or_else(|| panic!("{faults:?}"));
        let (value, sigma) = (fault["value"].as_f64().unwrap(), fault["sigma"].as_f64().unwrap());
        assert!((value - delay_s).abs() < 3.0 * sigma && sigma < 0.3, "{fault}");
        assert_eq!(fault["touches_points"], false, "{fault}");
    }
}

/// A T1 that depends on the valve is not in the catalogue of faults: no sensor is named for it.
#[test]
fn a_cause_outside_the_catalogue_is_none_of_the_faults() {
    let lab = "virtual_lab: {effects: {t1_with_valve: 2 K}}";
    let faults = faults(&[("virtual_lab: {}", lab), ("order: thermal", "tolerances: {}\norder: thermal")]);
    let [fault] = faults.as_slice() else { panic!("{faults:?}") };
    assert!(fault["fault"].as_str().unwrap().ends_with("(none of these)"), "{fault}");
    assert_eq!(fault["touches_points"], true, "{fault}");
}
