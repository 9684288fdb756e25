//! Campaigns on virtual stands whose actuators are slow: the shaft keeps its limits, and the compressor does not surge.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::shipped::campaign;
use crate::common::{Driven, driven, driven_to_the_end};
use mapper_campaign::Campaign;
use mapper_core::{AvoidedTime, EventKind, GuardName, RunEnding};
use mapper_session::{nominal_model, plan};
use proptest::prelude::*;

fn run(lab: &str, declared: &str, seed: u64) -> Driven {
    driven(&stand(lab, declared, seed, "speed: 170 krpm"))
}

/// Points from 50 to 155 krpm, at small and large openings, with these limits.
fn stand(lab: &str, declared: &str, seed: u64, limits: &str) -> Campaign {
    let (seed, rig) = (format!("{declared}seed: {seed}  "), format!("virtual_lab: {lab}"));
    campaign(&[
        ("virtual_lab: {}", &rig),
        ("seed: 1  ", &seed),
        ("speed: 180 krpm", limits),
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 110 krpm, 155 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.4, 2.5]"),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ])
}

fn assert_kept(driven: &Driven, stand: &str) {
    assert!(driven.steps.len() >= 9);
    assert!(
        driven.events.iter().all(|event| event.kind != EventKind::SurgeEntered),
        "{stand}: {:?}",
        driven.events
    );
    for step in &driven.steps {
        let highest_rpm = step.rows.iter().map(|row| row.1).fold(0.0, f64::max);
        let from_rpm = step.marker.from.map_or(0.0, |from| from.speed_rpm);
        // Four standard deviations of the sensor's noise, 30 rpm.
        let limit_rpm = 1.02 * step.target_rpm().max(from_rpm) + 120.0;
        assert!(highest_rpm <= limit_rpm, "{stand}: {highest_rpm} rpm in {:?}", step.marker);
    }
}

/// Not declared: pressure that follows in seconds. The runner finds it in the readings.
#[test]
fn a_slow_pressure_that_nobody_declared_causes_no_overspeed() {
    for (lag, slew) in [("3 s", "20 kPa/s"), ("8 s", "5 kPa/s")] {
        let lab = format!("{{actuators: {{turbine_inlet_pressure: {{lag: {lag}, slew: {slew}}}}}}}");
        let driven = run(&lab, "", 1);
        assert_kept(&driven, &lab);
        assert!(driven.steps.iter().all(|step| step.end_off_ratio().abs() < 0.01), "{lab}");
        assert!(
            driven.events.iter().any(|event| event.message.contains("rig.actuators")),
            "{lab}: the run says that the stand is slower than declared"
        );
    }
}

/// A valve that acknowledges its commands and stays where it is stops the run seconds after its second command if the guard says so.
#[test]
fn a_valve_that_does_not_move_ends_the_run_within_seconds() {
    let campaign =
        stand("{effects: {valve_stuck: 1}}", "guards: {valve: {reaction: safe}}\n", 1, "speed: 170 krpm");
    let (driven, end) = driven_to_the_end(&campaign);
    let RunEnding::Tripped(trip) = end else { panic!("{end:?}") };
    assert_eq!(trip.guard, GuardName::Valve);
    let [others @ .., last] = driven.steps.as_slice() else { panic!("no step") };
    let opening = |step: &crate::common::Step| step.marker.valve_opening_ratio;
    assert!(others.iter().all(|step| opening(step) == opening(&others[0])));
    assert_ne!(opening(last), opening(&others[0]));
    let after_s = trip.t_s - last.marker.start_s;
    assert!(after_s < 10.0, "{after_s} s");
}

/// A valve that is slower than declared, or has play, follows: no guard acts.
#[test]
fn a_valve_that_follows_late_or_with_play_is_not_stuck() {
    for lab in ["{actuators: {valve: {lag: 1 s, slew: 0.1 1/s}}}", "{actuators: {valve_play: 5 %}}"] {
        let events = driven(&stand(lab, "", 1, "speed: 170 krpm")).events;
        assert!(events.iter().all(|event| event.kind != EventKind::GuardActed), "{lab}: {events:?}");
    }
}

/// The shaft crosses the speeds to avoid as fast as the plan states, and within the time that is allowed.
#[test]
fn no_step_stays_within_the_speeds_to_avoid() {
    for actuators in ["fast_valve", "blow_down", "screw_compressor"] {
        let declared = format!("rig: {{actuators: {actuators}}}\n");
        let campaign = stand("{}", &declared, 1, "speed: 170 krpm\n  avoid: [{from: 88 krpm, to: 92 krpm}]");
        let avoid = campaign.limits.avoid;
        let plan = plan(&campaign, &nominal_model(&campaign).unwrap()).unwrap();
        let driven = driven(&campaign);
        assert_kept(&driven, actuators);
        let mut crossings = 0;
        for (step, planned) in driven.steps.iter().zip(&plan.steps) {
            let mut time = AvoidedTime::default();
            step.rows.iter().for_each(|row| time.add(&avoid, row.0, row.1));
            let planned_s = planned.transition.and_then(|way| way.avoided).map_or(0.0, |way| way.inside_s);
            let Some(recorded) = time.slowest(&avoid) else { continue };
            crossings += 1;
            assert!(recorded.inside_s <= recorded.range.longest_s, "{actuators}: {recorded:?}");
            // The samples are 0.1 s apart, and the loop has corrected P3 by up to some per cent.
            let stated_s = 0.3 + 1.1 * planned_s;
            assert!(recorded.inside_s <= stated_s, "{actuators}: {recorded:?}, {planned_s} s planned");
        }
        assert!(crossings >= 4, "{actuators}: jumps between 50 and 110 krpm cross the range");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn declared_stands_keep_speed_and_surge_margin(
        (lag_s, rate_kpa_s, dead_s) in (0.1..8.0f64, 5.0..200.0f64, 0.0..1.5f64),
        (valve_lag_s, valve_rate, play, dead_band) in (0.1..1.5f64, 0.2..2.0f64, 0.0..8.0f64, 0.0..2.0f64),
        seed in 1..100u64,
    ) {
        let declared = format!(
            "rig: {{actuators: {{turbine_inlet_pressure: {{lag: {lag_s:.2} s, rate: {rate_kpa_s:.1} kPa/s, dead_time: {dead_s:.2} s}}, \
             valve: {{lag: {valve_lag_s:.2} s, rate: {valve_rate:.2} 1/s, play: {play:.1} %, dead_band: {dead_band:.1} %}}}}}}\n"
        );
        assert_kept(&run("{}", &declared, seed), &declared);
    }
}
