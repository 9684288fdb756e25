//! The isothermal zero, from the campaign's key to the points.

use mapper_tests::{CampaignFile, mapper, scratch};
use serde_json::Value;
use std::path::Path;

/// Six points of the shipped campaign by the joint method, offsets drawn from their declaration, with `zero` before them.
fn run(zero: &str, seed: u32, out: &Path) -> Value {
    let seed = format!("repeats: off\n{zero}seed: {seed} ");
    let campaign = CampaignFile::shipped_with(&[
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 90 krpm, 140 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.0]"),
        // Temperatures alone: no soak says anything of a flow meter.
        ("m_c:   {noise: 1.5e-4 kg/s, gain: 0.5 %}", "m_c:   {noise: 1.5e-4 kg/s}"),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
        (
            "method: joint ",
            "joint: {alpha_area: fixed, probe: fixed, heating_cooling_ratio: fixed}\n  method: joint ",
        ),
        // The same steps with and without a zero.
        ("seed: 1 ", &seed),
    ]);
    let arguments =
        ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    mapper(arguments).exits(0).json()
}

/// For each point at the lowest speed: how far its efficiency is off, and the half of its interval.
fn slowest(result: &Value) -> Vec<(f64, f64)> {
    let points = result["points"].as_array().unwrap();
    let of = |point: &Value, key: &str| point[key].as_f64().unwrap();
    points
        .iter()
        .filter(|point| of(point, "speed_rpm") < 60e3)
        .map(|point| {
            let off = of(point, "eta") - of(&point["truth"], "eta");
            (off, 0.5 * (of(point, "eta_high") - of(point, "eta_low")))
        })
        .collect()
}

#[test]
fn a_soak_removes_the_offsets_from_the_slowest_points() {
    let scratch = scratch();
    let (mut without, mut with) = (Vec::new(), Vec::new());
    for seed in 1..=3 {
        without.extend(slowest(&run("", seed, &scratch.path().join("without"))));
        let result = run("zero: {soak: 30 min}\n", seed, &scratch.path().join("with"));
        // T1, T2, Tc and T_oil against each other, P1 against P2, each with its remaining uncertainty.
        for channel in ["T1", "T2", "Tc", "T_oil", "P1", "P2"] {
            assert!(result["zero"]["offsets"][channel].is_number(), "{}", result["zero"]);
            assert!(result["zero"]["left_sigma"][channel].as_f64().unwrap() > 0.0);
        }
        let points = slowest(&result);
        // The recording says where the soak was, and gives the same points again.
        let recording = result["recording"].as_str().unwrap();
        let again = mapper(["identify", recording, "--json"]).exits(0).json();
        assert_eq!(again["zero"], result["zero"]);
        assert_eq!(slowest(&again), points);
        with.extend(points);
    }
    let rms = |points: &[(f64, f64)]| {
        (points.iter().map(|(off, _)| off * off).sum::<f64>() / points.len() as f64).sqrt()
    };
    // Declared are 0.25 K on T1 and T2 and 0.3 K on Tc, left are 0.05 K: five times less, half of it counts as shrunk.
    assert!(rms(&with) < 0.5 * rms(&without), "{with:?} with, {without:?} without the zero");
    for ((_, with), (_, without)) in with.iter().zip(&without) {
        assert!(*with < 0.5 * *without, "intervals of {with} and {without}");
    }
}

/// A housing needs ten minutes to show its limit: it keeps its declared offset, and what rests is zeroed.
#[test]
fn a_soak_that_is_too_short_for_the_housing_zeroes_what_rests() {
    let scratch = scratch();
    let result = run("zero: {soak: 5 min}\n", 1, scratch.path());
    let zero = &result["zero"];
    for channel in ["T1", "T2", "P1", "P2"] {
        assert!(zero["offsets"][channel].is_number(), "{zero}");
    }
    let left_out: Vec<&str> =
        zero["left_out"].as_array().unwrap().iter().map(|left| left["channel"].as_str().unwrap()).collect();
    assert!(zero["offsets"]["Tc"].is_null() && left_out.contains(&"Tc"), "{zero}");
}
