//! The closed loop over the shaft speed on the virtual lab, sensor noise and actuators included.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::shipped::campaign;
use crate::common::{Driven, driven};
use mapper_core::EventKind;

/// Six points from 50 to 155 krpm, repeats and return included, two minutes each.
fn run(lab: &str, seed: u64, more: &[(&str, &str)]) -> Driven {
    let seed = format!("seed: {seed}  ");
    let replacements = [
        ("virtual_lab: {}", lab),
        ("seed: 1  ", seed.as_str()),
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 110 krpm, 155 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.4]"),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ];
    driven(&campaign(&[&replacements[..], more].concat()))
}

/// Longest ramp of a jump on the default lab, s.
const RAMP_S: f64 = 5.0;

const WORSE: &str = "virtual_lab: {effects: {turbine_efficiency: 0.9}}";

#[test]
fn a_worse_turbine_turns_as_fast_as_it_is_asked_to() {
    for seed in 1..=3 {
        let driven = run(WORSE, seed, &[]);
        assert!(driven.steps.len() >= 6);
        for step in &driven.steps {
            let target = step.target_rpm();
            let duration_s = step.marker.end_s - step.marker.start_s;
            // The band of the campaign, at the end and over the window that identification may use at the earliest.
            assert!(step.end_off_ratio().abs() < 0.003, "{seed} {target}: {}", step.end_off_ratio());
            let window = step.off_ratio(10.0, duration_s);
            assert!(window.abs() < 0.003, "{seed} {target}: {window}");
            assert!(!step.not_reached, "{seed} {target}");
            // The plan alone overshoots by 1.3 % on the nominal machine, with housings still hot: the loop adds nothing to that.
            assert!(step.overshoot_ratio().is_none_or(|ratio| ratio < 0.02), "{seed} {target}");
        }
        assert!(driven.highest_rpm < 180e3, "{seed}: {} rpm", driven.highest_rpm);
    }
}

/// What the loop is for: as planned, the same machine is off by per cents.
#[test]
fn without_the_loop_a_worse_turbine_is_too_slow() {
    let driven =
        run(WORSE, 1, &[("order: thermal_gradient ", "speed_control: off\norder: thermal_gradient ")]);
    assert!(driven.steps.iter().all(|step| step.end_off_ratio() < -0.02));
    assert!(
        driven
            .steps
            .iter()
            .all(|step| step.rows.iter().all(|row| row.2 == step.marker.p3_pa || row.0 <= RAMP_S))
    );
    assert!(
        driven.events.iter().all(|event| event.kind != EventKind::SpeedNotReached),
        "nothing was promised"
    );
}

/// On the nominal machine the loop has nothing to correct but the housings' slow change: its command is quieter than a
/// quarter of the pressure sensor's own noise, 80 Pa.
#[test]
fn on_the_nominal_machine_the_loop_is_quiet() {
    let driven = run("virtual_lab: {}", 1, &[]);
    for step in &driven.steps {
        assert!(step.p3_scatter_pa() < 20.0, "{} rpm: {} Pa", step.target_rpm(), step.p3_scatter_pa());
        assert!(step.end_off_ratio().abs() < 0.003);
        // The housings ask for no more than some per cent of the turbine's power.
        let moved = step
            .rows
            .iter()
            .filter(|row| row.0 > RAMP_S)
            .map(|row| (row.2 / step.marker.p3_pa - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(moved < 0.03, "{} rpm: {moved}", step.target_rpm());
    }
}

/// The worse turbine needs more than 288 kPa at 155 krpm. It says so, and the next step is right from the start.
#[test]
fn a_limit_of_p3_is_reported_and_nothing_winds_up() {
    let limits = [("{min: 110 kPa, max: 500 kPa}", "{min: 110 kPa, max: 288 kPa}")];
    let driven = run(WORSE, 1, &limits);
    let (reached, missed): (Vec<_>, Vec<_>) = driven.steps.iter().partition(|step| !step.not_reached);
    assert!(!missed.is_empty() && missed.iter().all(|step| step.target_rpm() == 155e3), "{}", missed.len());
    assert!(
        driven
            .events
            .iter()
            .any(|event| event.kind == EventKind::Note && event.message.contains("its upper limit"))
    );
    assert!(missed.iter().all(|step| step.rows.iter().all(|row| row.2 <= 288e3)));
    assert!(!reached.is_empty());
    for step in reached {
        let duration_s = step.marker.end_s - step.marker.start_s;
        // Within its settling time: 10 s as of any other step.
        assert!(step.off_ratio(10.0, duration_s).abs() < 0.003, "{}", step.target_rpm());
    }
}

#[test]
fn equal_seeds_give_equal_commands() {
    let commands = || -> Vec<f64> {
        let driven = run(WORSE, 2, &[]);
        driven.steps.iter().flat_map(|step| step.rows.iter().map(|row| row.2)).collect()
    };
    assert_eq!(commands(), commands());
}
