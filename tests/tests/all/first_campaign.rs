//! From a wheel's diameter to a map: `mapper init`, and the files that it writes.

use mapper_tests::{Finished, mapper_in, scratch};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

fn init(directory: &Path, further: &[&str]) -> Finished {
    mapper_in(directory, ["init", "own"].iter().chain(further).copied().collect::<Vec<_>>())
}

/// The first campaign of a machine runs on the virtual lab, and at least 80 % of its points are good.
#[test]
fn a_wheel_diameter_is_sufficient_for_a_first_map() {
    // `the_first_advice_of_check_helps_as_forecast` has 42 mm, `benches/first_campaign.py` all sizes.
    let scratch = scratch();
    init(scratch.path(), &["--wheel", "90mm"]).exits(0);
    let run = mapper_in(scratch.path(), ["run", "own.yaml", "--json", "--progress", "off"]).exits(0).json();
    let points = run["points"].as_array().unwrap();
    let good = points.iter().filter(|point| point["verdict"] == "good").count();
    assert!(points.len() >= 48 && 5 * good >= 4 * points.len(), "{good} of {}", points.len());
}

/// The verdicts are within the forecast of `check`, and after its first advice as many points are good as it promises at least.
#[test]
fn the_first_advice_of_check_helps_as_forecast() {
    // Without a zero, noise and offsets are too large at low speed; with half the dwell as well, all points depend on the declaration.
    // `benches/advice.py` has seven machines.
    let scratch = scratch();
    init(scratch.path(), &["--wheel", "42mm"]).exits(0);
    let path = scratch.path().join("own.yaml");
    let written = std::fs::read_to_string(&path).unwrap();
    let is_zero = |line: &&str| line.starts_with("zero:");
    let without: String =
        written.lines().filter(|line| !is_zero(line)).map(|line| format!("{line}\n")).collect();
    let flawed = without.replace("dwell: 60 s", "dwell: 30 s");
    let holds = |text: &str, forecast: &Value| {
        std::fs::write(&path, text).unwrap();
        let run = ["run", "own.yaml", "--json", "--progress", "off"];
        let good = good_points(&mapper_in(scratch.path(), run).exits(0).json());
        let [low, high] = ["good_low", "good_high"].map(|key| forecast[key].as_u64().unwrap());
        assert!((low..=high).contains(&good), "{good} good, {forecast} expected");
    };
    std::fs::write(&path, &flawed).unwrap();
    let checked = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(0).json();
    holds(&flawed, &checked["expected"]);
    let advice = &checked["advice"][0];
    let surely_good = |forecast: &Value| forecast["good_low"].as_u64().unwrap();
    assert!(surely_good(&advice["forecast"]) > surely_good(&checked["expected"]), "{checked}");
    let change = &advice["change"];
    let followed = match (change["soak_s"].as_f64(), change["dwell_s"].as_f64()) {
        (Some(soak_s), _) => format!("{flawed}zero: {{soak: {soak_s} s}}\n"),
        (_, Some(dwell_s)) => without.replace("dwell: 60 s", &format!("dwell: {dwell_s} s")),
        _ => panic!("{change}"),
    };
    holds(&followed, &advice["forecast"]);
}

/// Good points of a map as `check` counts them: without repeats, and of two visits the better one.
fn good_points(run: &Value) -> u64 {
    let mut best: BTreeMap<String, bool> = BTreeMap::new();
    for point in run["points"].as_array().unwrap().iter().filter(|point| point["kind"] != "repeat") {
        *best.entry(point["target"].to_string()).or_default() |= point["verdict"] == "good";
    }
    best.into_values().filter(|is_good| *is_good).count() as u64
}

#[test]
fn every_template_passes_its_check_and_nothing_is_overwritten() {
    for rig in ["virtual-lab", "gas-stand", "log"] {
        let scratch = scratch();
        init(scratch.path(), &["--wheel", "52mm", "--rig", rig]).exits(0);
        if rig == "log" {
            // Without a zero, `check` also looks for advice, which takes longest.
            mapper_in(scratch.path(), ["plan", "own.yaml"]).exits(0);
        } else {
            let checked = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(0).json();
            // All sizes but the wheel's are assumed.
            assert!(checked["assumed"].as_array().unwrap().len() >= 20, "{checked}");
        }
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

/// The reference state of a map's file is that of the campaign, without or with the same statement; another statement is a mistake.
#[test]
fn a_maps_own_reference_state_counts() {
    let scratch = scratch();
    let of = |name: &str, further: &[&str]| {
        let all = ["init", name, "--wheel", "60mm"].into_iter().chain(further.iter().copied());
        mapper_in(scratch.path(), all.collect::<Vec<_>>())
    };
    let state_of = |name: &str| {
        let file = format!("{name}.yaml");
        mapper_in(scratch.path(), ["check", &file]).exits(0);
        let text = std::fs::read_to_string(scratch.path().join(file)).unwrap();
        text.lines().find(|line| line.starts_with("reference:")).unwrap().to_owned()
    };
    let (stated, kelvin) = ("298.15 K, 100 kPa", "298.15 K");
    of("first", &["--reference", stated]).exits(0);
    assert!(state_of("first").contains(kelvin));
    let table = std::fs::read_to_string(scratch.path().join("first_map.csv")).unwrap();
    std::fs::write(scratch.path().join("map.csv"), format!("# reference: {stated}\n{table}")).unwrap();
    of("second", &["--map", "map.csv"]).exits(0);
    assert!(state_of("second").contains(kelvin));
    of("third", &["--map", "map.csv", "--reference", stated]).exits(0);
    assert_ne!(of("fourth", &["--map", "map.csv", "--reference", "BorgWarner"]).code, Some(0));
}

/// Changes the speed, flow, pressure ratio and efficiency of a row.
type Change = fn([f64; 4]) -> [f64; 4];

/// A map whose columns are in other units or exchanged, and limits of another machine, are one mistake each: for `check`, and for `init`.
#[test]
fn a_wrong_map_or_limit_is_one_mistake() {
    let scratch = scratch();
    init(scratch.path(), &["--wheel", "60mm"]).exits(0);
    let read = |name: &str| std::fs::read_to_string(scratch.path().join(name)).unwrap();
    let (text, table) = (read("own.yaml"), read("own_map.csv"));
    let write = |change: Change| {
        let row = |line: &str| {
            let fields: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
            Some(change(fields.try_into().ok()?).map(|x| x.to_string()).join(","))
        };
        let rows = table.lines().map(|line| row(line).unwrap_or_else(|| line.to_owned()));
        std::fs::write(scratch.path().join("own_map.csv"), rows.collect::<Vec<_>>().join("\n")).unwrap();
    };
    let is_one_mistake = |what: &str| {
        let found = mapper_in(scratch.path(), ["check", "own.yaml", "--json"]).exits(3).json();
        assert_eq!(found["findings"].as_array().unwrap().len(), 1, "{what}: {found}");
    };
    let changes: [(&str, Change); 7] = [
        ("flow in lb/min", |[n, flow, pr, eta]| [n, 132.277 * flow, pr, eta]),
        ("flow in kg/h", |[n, flow, pr, eta]| [n, 3600.0 * flow, pr, eta]),
        ("speed in 1/s", |[n, flow, pr, eta]| [n / 60.0, flow, pr, eta]),
        ("speed in rad/s", |[n, flow, pr, eta]| [0.10472 * n, flow, pr, eta]),
        ("pressure ratio minus 1", |[n, flow, pr, eta]| [n, flow, pr - 1.0, eta]),
        ("flow and pressure ratio exchanged", |[n, flow, pr, eta]| [n, pr, flow, eta]),
        ("flow and efficiency exchanged", |[n, flow, pr, eta]| [n, eta, pr, flow]),
    ];
    for (what, change) in changes {
        write(change);
        is_one_mistake(what);
        let message = init(scratch.path(), &["--wheel", "60mm", "--map", "own_map.csv", "--out", "other"]);
        let message = message.exits(3).stderr;
        assert!(!message.contains("own.yaml") && message.contains("own_map.csv"), "{what}: {message}");
    }
    std::fs::write(scratch.path().join("own_map.csv"), &table).unwrap();
    for (right, wrong) in [
        ("wheel_diameter: 60 mm", "wheel_diameter: 60 in"),
        ("wheel_diameter: 60 mm", "wheel_diameter: 2.36 mm"),
        ("  speed: 162 krpm", "  speed: 90 krpm"),
        ("max: 500 kPa", "max: 5 kPa"),
        ("compressor_outlet_temperature: 300 degC", "compressor_outlet_temperature: 300 K"),
    ] {
        assert!(text.contains(right), "{right}");
        std::fs::write(scratch.path().join("own.yaml"), text.replace(right, wrong)).unwrap();
        is_one_mistake(wrong);
    }
}

/// A file for another command is also reported once.
#[test]
fn a_file_of_another_kind_is_named_as_such() {
    let repository = mapper_tests::repository();
    for (command, file) in [
        ("check", "campaigns/nightly.yaml"),
        ("run", "campaigns/fleet/blind.yaml"),
        ("plan", "examples/channels/gap_rig.yaml"),
        ("check", "examples/effects/coolant_passage.rhai"),
        ("check", "plugins/formats/tests/tables/german.csv"),
        ("nightly", "campaigns/turbo_a.yaml"),
    ] {
        let found = mapper_in(&repository, [command, file, "--json"]).exits(3).json();
        assert_eq!(found["findings"].as_array().unwrap().len(), 1, "{command} {file}: {found}");
    }
}
