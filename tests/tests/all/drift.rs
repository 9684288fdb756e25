//! `mapper drift` finds drifts of the virtual lab in its recordings.

use mapper_tests::{DriftCampaign, mapper};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Twice the time between visits of the repeated jump, s.
const TWO_REPEATS_S: f64 = 2.0 * 8.0 * 120.0;

fn drift(recordings: &[&Path]) -> Value {
    let paths = recordings.iter().map(|path| path.as_os_str());
    mapper(["drift".as_ref(), "--json".as_ref()].into_iter().chain(paths)).exits(0).json()
}

#[test]
fn a_planted_drift_is_detected() {
    // At four to six times the printed limit. Steps, fouling and friction: `crates/diagnose/tests/drift`.
    let planted = "{cause: T2, change: 0.5 K, over: 1 h, from: 10 min}";
    let report =
        drift(&[&DriftCampaign { drift: planted, seed: 22, ..DriftCampaign::default() }.recording()]);
    let reason = &report["reason"];
    let drifts = report["drifts"].as_array().unwrap();
    assert_eq!((&report["verdict"], drifts.len()), (&"sensor".into(), 1), "{reason}");
    let number = |key: &str| drifts[0][key].as_f64().unwrap_or_else(|| panic!("{key} in {reason}"));
    assert_eq!(drifts[0]["cause"], "T2", "{reason}");
    assert!(drifts[0]["rate_per_h"].is_number(), "{reason}");
    assert!(number("low") <= 0.5 && 0.5 <= number("high"), "{reason}");
    assert!((number("onset_s") - 600.0).abs() < TWO_REPEATS_S, "{reason}");
}

#[test]
fn drift_compares_several_nights_and_refuses_another_machine() {
    // Half an hour with four visits of the jump.
    let night = |seed, drift, replaced: &[(&str, &str)]| {
        let speeds = "[90 krpm, 130 krpm, 70 krpm]";
        DriftCampaign { drift, seed, speeds, every: 4, replaced, ..DriftCampaign::default() }.recording()
    };
    // The rig is the same every night, its noise is not: no offsets or tolerances are drawn, and the seed, which is not part of the machine,
    // differs.
    let same_rig: &[(&str, &str)] =
        &[("    weather: wandering\n", "    weather: wandering\n    offsets: none\n")];
    let first = night(31, "", same_rig);
    // The gain of the flow meter drifts by 1 % in the ten hours in between.
    let second = night(32, "{cause: m_c, change: 1 %, over: 10 h, from: -10 h}", same_rig);
    let report = drift(&[&first, &second]);
    assert_eq!(
        [&report["verdict"], &report["drifts"][0]["cause"]],
        ["sensor", "m_c"],
        "{}",
        report["reason"]
    );
    assert_eq!(report["groups"][0]["visits"].as_array().unwrap().len(), 8);
    // The first night has no drift.
    assert_eq!(drift(&[&first])["verdict"], "none");

    // A rebuilt machine is another machine, and so is one of another name, before any reading is compared.
    let short = ("openings: [0.55, 0.7, 1.0]", "openings: [0.7]");
    let rebuilt =
        ("  map: closed_form\n", "  map: closed_form\n  geometry: {bearing: {oil_conductance: 9 W/K}}\n");
    let renamed = ("  serial_number: TA-0001\n", "  serial_number: TA-0002\n");
    for (seed, change) in [(33, rebuilt), (34, renamed)] {
        let other = night(seed, "", &[short, change]);
        let refused = drift(&[&first, &other]);
        assert_eq!((&refused["verdict"], &refused["drifts"]), (&"unclear".into(), &json!([])));
        let reason = refused["reason"].as_str().unwrap();
        assert!(reason.starts_with("No verdict") && reason.contains("machine"), "{reason}");
    }
}

/// The diagnosis reports a drift as such, not as an effect.
#[test]
fn the_gap_diagnosis_looks_for_drift_first() {
    let campaign = DriftCampaign {
        drift: "{cause: T2, change: 0.8 K, over: 1 h}",
        seed: 41,
        // Half an hour shows it: the diagnosis takes long over each step.
        speeds: "[90 krpm, 130 krpm, 70 krpm]",
        every: 4,
        ..DriftCampaign::default()
    };
    let recording = campaign.recording();
    let file = campaign.write();
    let arguments: [PathBuf; 5] =
        ["gap".into(), "diagnose".into(), file.path.clone(), "--recording".into(), recording];
    let diagnosis =
        mapper(arguments.iter().map(PathBuf::as_path).chain([Path::new("--json")])).exits(0).json();
    assert_eq!([&diagnosis["drift"]["verdict"], &diagnosis["drift"]["drifts"][0]["cause"]], ["sensor", "T2"]);
    assert_eq!(diagnosis["verdict"], "within_tolerance", "{}", diagnosis["candidates"][0]);
    let warning = &diagnosis["warnings"][0];
    assert_eq!((&warning["code"], &warning["subtracted"]), (&json!("drift"), &json!(true)), "{warning}");
}
