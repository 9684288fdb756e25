//! Error and coverage of the joint method over seeded campaigns of the lumped model:
//! `cargo run --release -p mapper-identify --example joint_study -- ALPHA PROBE_MM DIRECTION NOISE OFFSETS SEEDS FIRST OWN ASK DECLARED`
//! (noise and offsets in multiples of a good rig's; FIRST is the first seed, default 0; OWN 1 gives the machine its own law of h before the
//! wheel; ASK 0 does not compare the two laws; DECLARED is a fixed alpha_A, fitted by default).
#![allow(clippy::print_stdout, missing_docs, reason = "what it prints is all it is for")]
#[path = "../tests/common/mod.rs"]
#[allow(clippy::unwrap_used, reason = "shared with the tests")]
mod common;
#[path = "../tests/common/lab.rs"]
#[allow(clippy::unwrap_used, reason = "shared with the tests")]
mod lab;

use lab::{Machine, campaign, eighteen, measured};
use mapper_core::{InletConvection, Method};
use mapper_identify::{Choice, IdentifyConfig, JointSettings, WindowRule, identify, identify_recording};
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |i: usize, otherwise: f64| {
        std::env::args().nth(i).and_then(|text| text.parse().ok()).unwrap_or(otherwise)
    };
    let inlet = if argument(8, 0.0) > 0.0 { InletConvection::Own } else { InletConvection::Shared };
    let machine = Machine {
        alpha: argument(1, 0.0),
        probe_m: 1e-3 * argument(2, 0.0),
        direction: argument(3, 1.0),
        inlet,
        humidity_kg_kg: 0.0,
        ..Machine::default()
    };
    let mut settings = JointSettings::default();
    if argument(9, 1.0) == 0.0 {
        settings.inlet_h = Choice::Fixed;
    }
    let declared_alpha = argument(10, f64::NAN);
    if declared_alpha.is_finite() {
        settings.alpha_area = Choice::Fixed;
    }
    let (noise, offsets, seeds) = (argument(4, 1.0), argument(5, 1.0), argument(6, 20.0) as u64);
    let first = argument(7, 0.0) as u64;
    let clean = campaign(&eighteen(), 120.0, machine);
    let mut h_sum = 0.0;
    let (mut h_held, mut slow_held, mut slow_within, mut slow) = (0.0, 0.0, 0.0, 0.0);
    let (mut held, mut count, mut joint_sum, mut dynamic_sum) = (0.0, 0.0, 0.0, 0.0);
    for seed in first..first + seeds {
        let (recording, declared) =
            measured(&clean.recording, noise, offsets, &mut Pcg64::seed_from_u64(seed));
        let window = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
        let mut config =
            IdentifyConfig { method: Method::Joint, window, joint: settings, ..IdentifyConfig::default() };
        if declared_alpha.is_finite() {
            config.alpha_area_ratio = declared_alpha;
        }
        if noise + offsets > 0.0 {
            config.declared = declared;
        }
        let found = identify_recording(&recording, &config)?;
        let dynamic = identify(&recording, &IdentifyConfig { method: Method::Dynamic, ..config.clone() })?;
        let (mut own_held, mut own_count, mut joint_square, mut dynamic_square) = (0.0, 0.0, 0.0, 0.0);
        for ((point, dynamic), truth) in found.points.iter().zip(&dynamic).zip(&clean.truth) {
            let Ok(point) = point else { continue };
            let (Some(eta), Some(other)) = (point.eta, dynamic.eta) else { continue };
            let interval = ends(point.eta_low, point.eta_high)?;
            own_held += f64::from(u8::from(interval.contains(&truth.eta)));
            own_count += 1.0;
            let h_interval = ends(point.h_low_w_m2k, point.h_high_w_m2k)?;
            h_held += f64::from(u8::from(h_interval.contains(&truth.h_w_m2k)));
            if truth.speed_rpm < 55e3 {
                slow += 1.0;
                slow_held += f64::from(u8::from(interval.contains(&truth.eta)));
                slow_within += f64::from(u8::from((eta - truth.eta).abs() < 0.012));
            }
            h_sum += (point.h_w_m2k.unwrap_or(f64::NAN) / truth.h_w_m2k - 1.0).powi(2);
            joint_square += (eta - truth.eta).powi(2);
            dynamic_square += (other - truth.eta).powi(2);
        }
        let points = |square: f64| 100.0 * f64::sqrt(square / own_count);
        print!(
            "seed {seed}: joint {:.3}, dynamic {:.3} points rms, held {:.2}",
            points(joint_square),
            points(dynamic_square),
            own_held / own_count
        );
        if let Some(thermal) = &found.thermal {
            let shown = |value: &mapper_core::SharedValue| {
                format!(
                    "{:.4} +/- {:.4}",
                    value.value.unwrap_or(f64::NAN),
                    value.uncertainty.combined_standard_error()
                )
            };
            print!(
                "; alpha_A {}, probe {} m, direction {}, doubts {}",
                shown(&thermal.alpha_area_ratio),
                shown(&thermal.probe_diameter_m),
                shown(&thermal.direction_factor),
                thermal.doubts.len()
            );
            if let Some(inlet) = thermal.inlet {
                print!(
                    ", h before the wheel {:?} ({:.3}; alpha_A otherwise {:.4})",
                    inlet.convection,
                    inlet.probability,
                    inlet.alpha_area_otherwise_ratio.unwrap_or(f64::NAN)
                );
            }
        }
        println!();
        (held, count) = (held + own_held, count + own_count);
        (joint_sum, dynamic_sum) = (joint_sum + joint_square, dynamic_sum + dynamic_square);
    }
    println!(
        "all {count}: joint {:.3}, dynamic {:.3} points rms, h {:.2} % rms, intervals hold {:.3} (eta), {:.3} (h); at 50 krpm hold {:.3}, within 1.2 points {:.3}",
        100.0 * f64::sqrt(joint_sum / count),
        100.0 * f64::sqrt(dynamic_sum / count),
        100.0 * f64::sqrt(h_sum / count),
        held / count,
        h_held / count,
        slow_held / slow,
        slow_within / slow
    );
    Ok(())
}

/// A 95 % interval; the joint method gives both ends with every efficiency.
fn ends(low: Option<f64>, high: Option<f64>) -> Result<std::ops::RangeInclusive<f64>, &'static str> {
    Ok(low.ok_or("an efficiency without an interval")?..=high.ok_or("an efficiency without an interval")?)
}
