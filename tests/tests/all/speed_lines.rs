//! Corrected speed lines, and closed-loop control of the speed.

use mapper_tests::{CampaignFile, Finished, SHORT_GRID, mapper, scratch};
use serde_json::Value;
use std::path::Path;

const LINES: &str = "campaigns/turbo_a_lines.yaml";

fn run_into(campaign: &Path, out: &Path) -> Finished {
    mapper(["run".as_ref(), campaign.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()])
        .exits(0)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn the_shipped_speed_lines_are_shown_and_measured_at_their_speeds() {
    let checked = mapper(["check", LINES, "--json"]).exits(0).json();
    let lines = checked["lines"].as_array().unwrap();
    let speeds: Vec<f64> = lines.iter().map(|line| number(&line["speed_corrected_rpm"])).collect();
    assert_eq!(speeds, [60e3, 90e3, 120e3, 150e3]);
    let scratch = scratch();
    let result = run_into(LINES.as_ref(), scratch.path()).json();
    let points = result["points"].as_array().unwrap();
    for line in lines {
        for asked in line["points"].as_array().unwrap() {
            let opening = number(&asked["valve_opening_ratio"]);
            let near = |a: f64, b: f64, ratio: f64| (a / b - 1.0).abs() < ratio;
            let of = |point: &&Value| {
                near(number(&point["speed_corrected_rpm"]), number(&line["speed_corrected_rpm"]), 0.01)
                    && near(number(&point["valve"]), opening, 1e-9)
            };
            let found = points.iter().find(of).unwrap_or_else(|| panic!("{asked} was not measured"));
            // The loop's band.
            let speed = number(&found["speed_corrected_rpm"]);
            assert!(near(speed, number(&line["speed_corrected_rpm"]), 0.003), "{speed} for {line}");
            // Four standard deviations of the meter's gain, 0.5 %; the lab is the nominal machine.
            let flow = number(&found["flow_corrected_kg_s"]);
            assert!(near(flow, number(&asked["flow_corrected_kg_s"]), 0.025), "{flow} for {asked}");
        }
    }
}

/// With a turbine that is 10 % worse and limited P3, the points have the reached speed.
#[test]
fn a_speed_that_cannot_be_reached_is_reported_with_its_point() {
    let mut replacements = SHORT_GRID.to_vec();
    replacements.extend([
        ("virtual_lab: {}", "virtual_lab: {effects: {turbine_efficiency: 0.9}}"),
        ("{min: 110 kPa, max: 500 kPa}", "{min: 110 kPa, max: 221 kPa}"),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ]);
    let campaign = CampaignFile::shipped_with(&replacements);
    let result = run_into(&campaign.path, &campaign.runs()).json();
    let missed = |point: &&Value| {
        point["warnings"].as_array().unwrap().iter().any(|warning| warning["code"] == "speed_not_reached")
    };
    let points = result["points"].as_array().unwrap();
    let (slow, right): (Vec<&Value>, Vec<&Value>) = points.iter().partition(missed);
    assert!(!slow.is_empty() && !right.is_empty(), "{} of {}", slow.len(), points.len());
    for (points, band) in [(&slow, 0.003..0.1), (&right, -0.003..0.003)] {
        for point in points {
            let short = 1.0 - number(&point["speed_rpm"]) / number(&point["target"]["speed_rpm"]);
            assert!(band.contains(&short), "{short} {point}");
        }
    }
}

/// A replayed rig gives the same speeds, and the loop asks for the same pressures: none of them is reported to differ.
#[test]
fn a_replayed_run_uses_the_recorded_commands() {
    let lab = "virtual_lab: {effects: {turbine_efficiency: 0.9}}";
    let mut replacements = SHORT_GRID.to_vec();
    replacements.extend([
        ("virtual_lab: {}", lab),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ]);
    let campaign = CampaignFile::shipped_with(&replacements);
    let first = run_into(&campaign.path, &campaign.runs()).json();
    let replay = format!("replay: {{recording: {}}}", first["recording"]);
    let again = CampaignFile::of(campaign.text.replace(lab, &replay));
    let second = run_into(&again.path, &again.runs()).json();
    let report =
        std::fs::read_to_string(Path::new(second["run"].as_str().unwrap()).join("report.md")).unwrap();
    assert!(!report.contains("in the recording being replayed"), "{report}");
    let efficiencies = |result: &Value| -> Vec<f64> {
        result["points"].as_array().unwrap().iter().filter_map(|point| point["eta"].as_f64()).collect()
    };
    assert_eq!(efficiencies(&first), efficiencies(&second));
}
