//! From a wheel's diameter to a map: `mapper init`, and the files that it writes.

use mapper_tests::{Finished, mapper_in, scratch};
use std::path::Path;

fn init(directory: &Path, further: &[&str]) -> Finished {
    mapper_in(directory, ["init", "own"].iter().chain(further).copied().collect::<Vec<_>>())
}

/// The first campaign of a machine runs on the virtual lab, and at least 80 % of its points are good.
#[test]
fn a_wheel_diameter_is_sufficient_for_a_first_map() {
    // `the_forecast_verdicts_match_a_run` has 60 mm.
    for wheel in ["35mm", "90mm"] {
        let scratch = scratch();
        init(scratch.path(), &["--wheel", wheel]).exits(0);
        mapper_in(scratch.path(), ["check", "own.yaml"]).exits(0);
        let run =
            mapper_in(scratch.path(), ["run", "own.yaml", "--json", "--progress", "off"]).exits(0).json();
        let points = run["points"].as_array().unwrap();
        let good = points.iter().filter(|point| point["verdict"] == "good").count();
        assert!(points.len() >= 48 && 5 * good >= 4 * points.len(), "{wheel}: {good} of {}", points.len());
    }
}

/// Verdicts come out as `check` forecasts them, before and after its advice to soak. Shares of good points may differ by 15 %: some of the
/// standard errors are near their limit, and steps that repeat a point count among the measured ones.
#[test]
fn the_forecast_verdicts_match_a_run() {
    let scratch = scratch();
    init(scratch.path(), &["--wheel", "60mm"]).exits(0);
    let path = scratch.path().join("own.yaml");
    let written = std::fs::read_to_string(&path).unwrap();
    let without: String =
        written.lines().filter(|line| !line.starts_with("zero:")).map(|line| format!("{line}\n")).collect();
    let holds = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let checked = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(0).json();
        let expected = &checked["expected"];
        let expected = expected["good"].as_f64().unwrap() / expected["points"].as_f64().unwrap();
        let run =
            mapper_in(scratch.path(), ["run", "own.yaml", "--json", "--progress", "off"]).exits(0).json();
        let points = run["points"].as_array().unwrap();
        let good = points.iter().filter(|point| point["verdict"] == "good").count() as f64;
        let share = good / points.len() as f64;
        assert!((share - expected).abs() <= 0.15, "{share} good, {expected} expected");
        (share, checked)
    };
    let (before, checked) = holds(&without);
    let mut advice = checked["advice"].as_array().unwrap().iter();
    let soak_s = advice.find_map(|advice| advice["change"]["soak_s"].as_f64()).unwrap();
    let (after, _) = holds(&format!("{without}zero: {{soak: {soak_s} s}}\n"));
    assert!(after >= 0.8, "{after} good");
    assert!(after > before, "{after} after the advice, {before} before");
}

#[test]
fn every_template_passes_its_check_and_nothing_is_overwritten() {
    for rig in ["virtual-lab", "gas-stand", "log"] {
        let scratch = scratch();
        init(scratch.path(), &["--wheel", "52mm", "--rig", rig]).exits(0);
        let checked = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(0).json();
        // All sizes but the wheel's are assumed.
        assert!(checked["assumed"].as_array().unwrap().len() >= 20, "{checked}");
        let before = std::fs::read(scratch.path().join("own.yaml")).unwrap();
        init(scratch.path(), &["--wheel", "60mm", "--rig", rig]).exits(1);
        assert_eq!(std::fs::read(scratch.path().join("own.yaml")).unwrap(), before);
        assert_eq!(scratch.path().join("own_channels.yaml").exists(), rig != "virtual-lab");
    }
    let scratch = scratch();
    // No terminal to ask on.
    init(scratch.path(), &[]).exits(3);
    assert!(!scratch.path().join("own.yaml").exists());
}

/// A map in lb/min that claims kg/s, and a limit in the wrong unit, are one mistake each.
#[test]
fn a_wrong_unit_is_reported_once() {
    let scratch = scratch();
    init(scratch.path(), &["--wheel", "60mm"]).exits(0);
    let (campaign, map) = (scratch.path().join("own.yaml"), scratch.path().join("own_map.csv"));
    let (text, table) = (std::fs::read_to_string(&campaign).unwrap(), std::fs::read_to_string(&map).unwrap());
    let mistakes = || {
        let found = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(3).json();
        found["findings"].as_array().unwrap().len()
    };
    let scaled = table.lines().map(|line| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Some(flow) = fields.get(1).and_then(|field| field.parse::<f64>().ok()) {
            // lb/min of a flow in kg/s.
            fields[1] = (132.277 * flow).to_string();
        }
        fields.join(",")
    });
    std::fs::write(&map, scaled.collect::<Vec<_>>().join("\n")).unwrap();
    assert_eq!(mistakes(), 1);
    std::fs::write(&map, table).unwrap();
    let limit = text.lines().find(|line| line.starts_with("  speed: ") && line.ends_with("krpm")).unwrap();
    std::fs::write(&campaign, text.replace(limit, "  speed: 100 rpm")).unwrap();
    assert_eq!(mistakes(), 1);
}

/// Suppliers' maps become nominal maps: a workbook, and German text with units in its headings.
#[test]
fn a_suppliers_map_is_converted() {
    for file in ["sae.xlsx", "german.csv"] {
        let scratch = scratch();
        let map = mapper_tests::repository().join("plugins/formats/tests/tables").join(file);
        init(scratch.path(), &["--wheel", "70mm", "--map", map.to_str().unwrap()]).exits(0);
        let checked = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(0).json();
        assert_eq!(checked["points"], 48);
        // Monotone cubics stay within the map, 0.03 to 0.301 kg/s.
        let table = std::fs::read_to_string(scratch.path().join("own_map.csv")).unwrap();
        let flow = |row: &str| row.split(',').nth(1).unwrap().parse::<f64>().unwrap();
        let flows: Vec<f64> = table.lines().skip(2).map(flow).collect();
        assert!(flows.len() >= 100 && flows.iter().all(|flow| (0.029..0.304).contains(flow)));
    }
}

/// A file for another command is also reported once.
#[test]
fn a_nightly_file_is_named_as_such() {
    let file = mapper_tests::repository().join("campaigns/nightly.yaml");
    let found =
        mapper_in(&mapper_tests::repository(), ["check".as_ref(), file.as_os_str(), "--json".as_ref()]);
    assert_eq!(found.exits(3).json()["findings"].as_array().unwrap().len(), 1);
}
