//! Nights of many drawn machines of one kind.

use mapper_tests::{mapper_in, repository, scratch};
use serde_json::Value;
use std::path::Path;

/// Six points by the quick method on drawn machines.
fn write(folder: &Path, machines: &str) {
    let shipped = std::fs::read_to_string(repository().join("campaigns/nightly/turbo_a.yaml")).unwrap();
    let from = "speeds: [50 krpm, 70 krpm, 90 krpm, 110 krpm, 130 krpm, 150 krpm]";
    assert!(shipped.contains(from));
    let small = shipped
        .replace(from, "speeds: [70 krpm, 100 krpm, 130 krpm]")
        .replace("openings: [0.5, 0.7, 1.0, 1.4, 2.0]", "openings: [0.7, 1.0]")
        // Two thirds of the recording otherwise.
        .replace("warm_up: 10 min ", "warm_up: 60 s ")
        .replace("zero: {soak: 30 min} ", "");
    std::fs::write(folder.join("small.yaml"), small).unwrap();
    std::fs::write(folder.join("nightly.yaml"), format!(
        "nightly: production\nhistory: history.db\nruns:\n  - {{campaign: small.yaml, methods: [dynamic], seeds: [1, 2], {machines}}}\n"
    ))
    .unwrap();
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}

/// A drawn machine is the same every night, whatever the seed of the noise.
#[test]
fn a_drawn_machine_is_the_same_in_every_run() {
    let scratch = scratch();
    write(scratch.path(), "drawn_machines: 3");
    let night = mapper_in(scratch.path(), ["nightly", "nightly.yaml", "--json"]).exits(0).json();
    let runs = night["night"]["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 6);
    let truth = |machine: &str, seed: u64| {
        let run = runs
            .iter()
            .find(|run| run["machine"].as_str().unwrap().ends_with(machine) && run["seed"] == seed);
        let points = run.unwrap()["points"].as_array().unwrap().clone();
        points.iter().map(|point| (number(point, "speed_rpm"), number(point, "eta_true"))).collect::<Vec<_>>()
    };
    let mean = |points: &[(f64, f64)]| points.iter().map(|(_, eta)| eta).sum::<f64>() / points.len() as f64;
    let (again, other) = (mean(&truth("-0001", 2)), mean(&truth("-0002", 1)));
    let first = mean(&truth("-0001", 1));
    assert!((first - again).abs() < 0.2 * (first - other).abs(), "{first} {again} {other}");
}
