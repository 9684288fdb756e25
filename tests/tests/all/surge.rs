//! The surge search, from the campaign's key to the marks of the map.

use mapper_tests::{CampaignFile, mapper, scratch};
use serde_json::Value;
use std::path::Path;

/// Two lines of the shipped campaign, each at one opening, with a search for surge behind them on a lab with these settings.
fn run(search: &str, lab: &str, seed: u32, out: &Path) -> Value {
    let seed = format!("repeats: off\nreturn_to_first: false\n{search}seed: {seed} ");
    let lab = format!("virtual_lab: {{{lab}}}");
    let campaign = CampaignFile::shipped_with(&[
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [80 krpm, 125 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 0.5]"),
        ("warm_up: 2 min ", "warm_up: 60 s "),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
        ("method: joint ", "method: dynamic "),
        ("virtual_lab: {}", &lab),
        ("formats: [csv, json, svg]", "formats: [json, surge]"),
        ("seed: 1 ", &seed),
    ]);
    let arguments =
        ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    mapper(arguments).exits(0).json()
}

fn value(mark: &Value, key: &str) -> f64 {
    mark[key].as_f64().unwrap()
}

#[test]
fn surge_is_found_on_every_line_without_surging_and_again_from_the_recording() {
    let scratch = scratch();
    for seed in 1..=3 {
        // The flow meter's gain is not part of the search.
        let result = run("surge_search: {}\n", "offsets: none", seed, &scratch.path().join(seed.to_string()));
        let surge = &result["surge"];
        assert_eq!(surge["surges"], 0, "{surge}");
        let marks = surge["marks"].as_array().unwrap();
        assert_eq!(marks.len(), 2, "{surge}");
        for mark in marks {
            let truth = value(mark, "truth_flow_corrected_kg_s");
            let off = value(mark, "flow_corrected_kg_s") / truth - 1.0;
            // The standard error that a line ends with is 0.8 to 1.2 %; three of it.
            assert!(off.abs() < 0.03, "seed {seed}: off by {off} at {mark}");
            assert!(value(mark, "closest_flow_corrected_kg_s") > 0.995 * truth, "{mark}");
            assert_eq!(mark["found_by"], "precursor");
        }
        let recording = result["recording"].as_str().unwrap();
        let again = mapper(["identify", recording, "--json"]).exits(0).json();
        assert_eq!(&again["surge"], surge);
        let map: Value =
            serde_json::from_str(&std::fs::read_to_string(result["map"]["json"].as_str().unwrap()).unwrap())
                .unwrap();
        assert_eq!(map["surge"].as_array().unwrap().len(), 2);
    }
}

#[test]
fn the_surge_search_does_not_change_the_points() {
    let scratch = scratch();
    let with = run("surge_search: {}\n", "", 1, &scratch.path().join("with"));
    let without = run("", "", 1, &scratch.path().join("without"));
    assert_eq!(with["points"], without["points"]);
    assert!(without.get("surge").is_none());
}

/// Without a precursor, only surge itself can be detected.
#[test]
fn surge_without_precursor_opens_the_valve_and_is_reported() {
    let scratch = scratch();
    let result = run("surge_search: {}\n", "surge_precursor: {size: 0 %}", 1, scratch.path());
    let surge = &result["surge"];
    assert_eq!(surge["surges"], 2, "{surge}");
    for mark in surge["marks"].as_array().unwrap() {
        assert_eq!(mark["found_by"], "surge");
        let off = value(mark, "flow_corrected_kg_s") / value(mark, "truth_flow_corrected_kg_s") - 1.0;
        // Half of a step of 3 %, and the flow meter's 0.5 %.
        assert!(off.abs() < 0.03, "{mark}");
    }
    assert!(result["failure"].is_null(), "{}", result["failure"]);
}

/// Soft surge is where the lab's fluctuation has grown the variation of P2 as much as the campaign asks for: its variance is (0.06 %)^2 (25 %/margin - 1), and the sensor adds 60 Pa.
#[test]
fn soft_surge_is_where_fast_samples_of_p2_vary_as_much_as_declared() {
    let scratch = scratch();
    let result =
        run("surge_search: {soft_surge: 1.8}\n", "offsets: none, fast_rate: 1 kHz", 1, scratch.path());
    for mark in result["surge"]["marks"].as_array().unwrap() {
        let soft = &mark["soft"];
        assert_eq!(soft["channel"], "P2", "{mark}");
        let variation = value(soft, "variation_ratio");
        assert!((variation / value(soft, "quiet_ratio") - 1.8).abs() < 1e-9, "{soft}");
        let noise = 60.0 / (1e5 * value(soft, "pressure_ratio"));
        let margin = 0.25 / (1.0 + (variation * variation - noise * noise) / 6e-4_f64.powi(2));
        let found = value(soft, "flow_corrected_kg_s") / value(mark, "truth_flow_corrected_kg_s") - 1.0;
        // An opening apart is 3 % of flow.
        assert!((found - margin).abs() < 0.03, "margin {found} for {margin}: {mark}");
    }
    let table = std::fs::read_to_string(result["map"]["surge"].as_str().unwrap()).unwrap();
    assert!(table.contains("soft_flow_corrected_kg_s") && table.contains("1.8 times"), "{table}");
}
