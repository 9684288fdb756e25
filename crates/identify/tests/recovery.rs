//! Data that follow eqs. 1-3 exactly give back the efficiency and the heat-transfer coefficient they were made from.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::{STEP_S, Transient};
use mapper_core::{Channel, EstimateUncertainty, Event, EventKind, Method, OperatingPoint, Verdict, Warning};
use mapper_identify::{
    DeclaredUncertainty, IdentifyConfig, IdentifyError, PressureTap, WindowRule, identify,
};
use mapper_physics::gas::pressure_tap::total_to_static_pa;
use proptest::prelude::*;

fn config(alpha_area_ratio: f64) -> IdentifyConfig {
    let window = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
    IdentifyConfig { window, alpha_area_ratio, ..IdentifyConfig::default() }
}

fn transients() -> impl Strategy<Value = Transient> {
    let places = (285.0..310.0f64, 1.1..3.0f64, 0.02..0.1f64, 0.4..0.85f64, 200.0..3500.0f64);
    let housings = (300.0..400.0f64, 10.0..60.0f64, any::<bool>(), 20.0..90.0f64, 0.0..0.5f64);
    (places, housings).prop_map(|((t1_k, pressure_ratio, flow_kg_s, eta, h_w_m2k), housing)| {
        let (tc_start_k, change_k, up, time_constant_s, alpha_area_ratio) = housing;
        Transient {
            t1_k,
            pressure_ratio,
            flow_kg_s,
            tc_start_k,
            tc_end_k: if up { tc_start_k + change_k } else { tc_start_k - change_k },
            time_constant_s,
            eta,
            h_w_m2k,
            alpha_area_ratio,
        }
    })
}

proptest! {
    // No files next to the sources.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Rounding of T2 (6e-14 K) times the ill-conditioning of the worst of these transients stays far below 1e-8.
    #[test]
    fn efficiency_and_heat_transfer_come_back(transient in transients()) {
        let points = identify(&transient.recording(), &config(transient.alpha_area_ratio)).unwrap();
        let point = &points[1];
        prop_assert!((point.eta.unwrap() / transient.eta - 1.0).abs() < 1e-8, "{point:?}");
        prop_assert!((point.h_w_m2k.unwrap() / transient.h_w_m2k - 1.0).abs() < 1e-8, "{point:?}");
    }
}

/// A wrong area share before compression causes an error of points, as in the paper (7-15 points at 0.2).
#[test]
fn a_wrong_area_split_costs_points() {
    let transient = Transient { alpha_area_ratio: 0.2, ..Transient::default() };
    let points = identify(&transient.recording(), &config(0.0)).unwrap();
    assert!((points[1].eta.unwrap() - transient.eta).abs() > 0.03);
}

#[test]
fn the_first_step_has_no_transient() {
    let points = identify(&Transient::default().recording(), &config(0.0)).unwrap();
    assert_eq!((points[0].verdict, points[0].eta, points[0].eta_low), (Verdict::Unusable, None, None));
    assert_eq!(points[0].warnings[0].code(), "no_transient");
    // Its position on the map is still known.
    assert!((points[0].pressure_ratio - 1.7).abs() < 1e-12);
}

/// Without heat transfer the apparent efficiency is the efficiency.
#[test]
fn the_steady_method_is_right_where_no_heat_flows() {
    let transient = Transient { h_w_m2k: 0.0, ..Transient::default() };
    let config = IdentifyConfig { method: Method::Steady, ..IdentifyConfig::default() };
    let points = identify(&transient.recording(), &config).unwrap();
    for point in &points {
        assert!((point.eta.unwrap() - transient.eta).abs() < 1e-12);
        assert_eq!(point.h_w_m2k, None);
    }
    assert_eq!(points[1].warnings[0].code(), "not_settled");
    assert_eq!(points[0].warnings[0].code(), "apparent");
}

/// Static taps: a recording of static pressures gives the same result as one of total pressures.
#[test]
fn static_taps_are_converted() {
    let transient = Transient::default();
    let mut recording = transient.recording();
    let (inlet_m, outlet_m) = (0.04, 0.035);
    let t2_k = recording.series[&Channel::T2].values.clone();
    for (channel, diameter_m) in [(Channel::P1, inlet_m), (Channel::P2, outlet_m)] {
        let series = recording.series.get_mut(&channel).unwrap();
        for (value, t2_k) in series.values.iter_mut().zip(&t2_k) {
            let temperature_k = if channel == Channel::P1 { transient.t1_k } else { *t2_k };
            *value = total_to_static_pa(*value, transient.flow_kg_s, temperature_k, diameter_m).unwrap();
        }
    }
    let taken_for_total = &identify(&recording, &config(0.0)).unwrap()[1];
    let converted = IdentifyConfig {
        inlet_tap: PressureTap::Static { pipe_diameter_m: inlet_m },
        outlet_tap: PressureTap::Static { pipe_diameter_m: outlet_m },
        ..config(0.0)
    };
    let converted = &identify(&recording, &converted).unwrap()[1];
    assert!((converted.eta.unwrap() - transient.eta).abs() < 1e-7);
    assert!((converted.pressure_ratio - transient.pressure_ratio).abs() < 1e-6);
    assert!((taken_for_total.eta.unwrap() - transient.eta).abs() > 1e-3);
}

/// The bias part of the standard error equals the actual effect of a sensor's offset: each sensor is shifted by its sigma.
#[test]
fn declared_offsets_move_the_result_as_declared() {
    let transient = Transient { alpha_area_ratio: 0.1, ..Transient::default() };
    let (offset, gain) = ([0.25, 0.25, 0.3, 50.0, 100.0, 2e-4], 0.005);
    let channels = [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2, Channel::CompressorFlow];
    // The error of assuming a constant h adds to the sensors' share in quadrature.
    let bias = |u: Option<EstimateUncertainty>, base: f64| {
        (u.unwrap().bias_standard_error.powi(2) - base * base).max(0.0).sqrt()
    };
    let undeclared = &identify(&transient.recording(), &config(0.1)).unwrap()[1];
    let base = [bias(undeclared.eta_uncertainty, 0.0), bias(undeclared.h_uncertainty, 0.0)];
    let mut sum = 0.0;
    let mut all = config(0.1);
    for (channel, offset) in channels.into_iter().zip(offset) {
        for (offset_sigma, gain_sigma_ratio) in [(offset, 0.0), (0.0, gain)] {
            let declared = DeclaredUncertainty { noise_sigma: 0.0, offset_sigma, gain_sigma_ratio };
            let mut alone = config(0.1);
            alone.declared.insert(channel, declared);
            let stated = &identify(&transient.recording(), &alone).unwrap()[1];
            let shifted = |sign: f64| {
                let mut recording = transient.recording();
                for value in &mut recording.series.get_mut(&channel).unwrap().values {
                    *value += sign * (offset_sigma + gain_sigma_ratio * channel.gain_distance(*value));
                }
                let point = identify(&recording, &alone).unwrap().swap_remove(1);
                [point.eta.unwrap(), point.h_w_m2k.unwrap()]
            };
            let (up, down) = (shifted(1.0), shifted(-1.0));
            let stated = [bias(stated.eta_uncertainty, base[0]), bias(stated.h_uncertainty, base[1])];
            for (i, size) in [(0, 1.0), (1, 1e3)] {
                let moved = 0.5 * (up[i] - down[i]).abs();
                // Second-order effects of the offset remain: a few percent for 2 K of gain error. If the flow is constant its gain goes into h
                // alone.
                let tolerance = 0.05 * stated[i] + 1e-9 * size;
                assert!(
                    (moved - stated[i]).abs() < tolerance,
                    "{channel}: moved {moved:.2e}, stated {:.2e}",
                    stated[i]
                );
            }
            sum += stated[0].powi(2);
        }
        let both = DeclaredUncertainty { noise_sigma: 0.0, offset_sigma: offset, gain_sigma_ratio: gain };
        all.declared.insert(channel, both);
    }
    let together = &identify(&transient.recording(), &all).unwrap()[1];
    assert!((bias(together.eta_uncertainty, base[0]) / sum.sqrt() - 1.0).abs() < 1e-6);
}

#[test]
fn missing_channels_are_all_named() {
    let mut recording = Transient::default().recording();
    recording.series.remove(&Channel::Tc);
    recording.series.remove(&Channel::P1);
    let error = identify(&recording, &config(0.0)).unwrap_err();
    assert!(
        matches!(&error, IdentifyError::MissingChannels { missing, .. } if missing == &[Channel::P1, Channel::Tc])
    );
    assert!(error.to_string().contains("Tc (compressor housing temperature)"));
    // The steady method does not need the housing.
    let steady = IdentifyConfig { method: Method::Steady, ..config(0.0) };
    recording.series.insert(Channel::P1, Transient::default().recording().series[&Channel::P1].clone());
    assert!(identify(&recording, &steady).is_ok());
    recording.steps.clear();
    assert_eq!(identify(&recording, &steady), Err(IdentifyError::NoSteps));
}

/// The window starts when the signals have settled: here after 20 s, when the speed stops changing.
#[test]
fn the_window_starts_where_the_operating_point_has_stabilised() {
    let mut recording = Transient::default().recording();
    let speed = recording.series.get_mut(&Channel::ShaftSpeed).unwrap();
    for (t_s, value) in speed.t_s.iter().zip(&mut speed.values) {
        let since_s = t_s - 30.0;
        if (0.0..20.0).contains(&since_s) {
            *value *= 0.8 + 0.01 * since_s;
        }
    }
    let point = &identify(&recording, &IdentifyConfig::default()).unwrap()[1];
    let window = point.window.unwrap();
    // 0.8 % below the end is reached 19.2 s after the jump; blocks are 1 s.
    assert!((window.start_s - 30.0 - 19.2).abs() <= 1.0, "{window:?}");
    assert_eq!(window.end_s, 30.0 + STEP_S);
    assert_eq!(point.verdict, Verdict::Good);
}

#[test]
fn an_operating_point_that_never_rests_is_doubtful() {
    let mut recording = Transient::default().recording();
    let flow = recording.series.get_mut(&Channel::CompressorFlow).unwrap();
    for (t_s, value) in flow.t_s.iter().zip(&mut flow.values) {
        *value *= 1.0 + 0.003 * (t_s - 30.0).max(0.0);
    }
    let point = &identify(&recording, &IdentifyConfig::default()).unwrap()[1];
    assert_ne!(point.verdict, Verdict::Good);
    assert!(point.warnings.iter().any(|warning| warning.code() == "not_stabilised"));
}

/// The quantity with the last command change settles last: the window starts after it.
#[test]
fn a_command_that_ramps_moves_the_window() {
    let mut recording = Transient::default().recording();
    let command = recording.series.entry(Channel::P3Command).or_default();
    for (t_s, value) in [(0.0, 120e3), (30.0, 140e3), (40.0, 170e3), (41.0, 170e3), (150.0, 120e3)] {
        command.t_s.push(t_s);
        command.values.push(value);
    }
    let point = &identify(&recording, &IdentifyConfig::default()).unwrap()[1];
    assert!((point.window.unwrap().start_s - 50.0).abs() < 1e-9);
}

/// A loop that holds the speed moves P3 by a few permille as the housings warm: the jump was over long before.
#[test]
fn a_command_that_is_trimmed_leaves_the_window_alone() {
    let mut recording = Transient::default().recording();
    let untrimmed = identify(&recording, &IdentifyConfig::default()).unwrap()[1].window.unwrap();
    let command = recording.series.entry(Channel::P3Command).or_default();
    for (t_s, value) in [(0.0, 120e3), (30.0, 170e3)] {
        command.t_s.push(t_s);
        command.values.push(value);
    }
    for second in 31..150 {
        command.t_s.push(f64::from(second));
        command.values.push(170e3 * (1.0 + 2e-3 * (f64::from(second) / 20.0).sin()));
    }
    let point = &identify(&recording, &IdentifyConfig::default()).unwrap()[1];
    assert_eq!(point.window.unwrap(), untrimmed);
}

/// A remark gives both speeds if a speed was not reached; the point keeps its verdict, since it is only elsewhere on the map.
#[test]
fn a_speed_that_was_not_reached_is_a_remark() {
    let mut recording = Transient::default().recording();
    recording.steps[1].from = Some(OperatingPoint { speed_rpm: 50e3, valve_opening_ratio: 0.7 });
    recording.steps[1].to = Some(OperatingPoint { speed_rpm: 123e3, valve_opening_ratio: 0.7 });
    let plain = identify(&recording, &IdentifyConfig::default()).unwrap()[1].clone();
    let t_s = recording.steps[1].end_s;
    recording.events.push(Event { t_s, kind: EventKind::SpeedNotReached, message: String::new() });
    let warned = identify(&recording, &IdentifyConfig::default()).unwrap()[1].clone();
    assert_eq!((warned.verdict, warned.eta), (plain.verdict, plain.eta));
    let remark = Warning::SpeedNotReached { requested_rpm: 123e3, reached_rpm: warned.speed_rpm };
    assert!(warned.warnings.contains(&remark), "{:?}", warned.warnings);
    assert!(plain.warnings.iter().all(|warning| warning.code() != "speed_not_reached"));
}
