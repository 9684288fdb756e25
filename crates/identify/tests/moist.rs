//! Moist air: a known humidity makes the points right, an unknown one makes their intervals wider.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::lab::{Machine, campaign, eighteen, measured};
use mapper_core::{Channel, IdentifiedPoint, Method, Series};
use mapper_identify::{IdentifyConfig, identify};
use mapper_physics::gas::air::Air;
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// 35 degC at 80 %.
const HUMIDITY_KG_KG: f64 = 0.0291;

fn joint(air: Air, humidity_sigma_kg_kg: f64) -> IdentifyConfig {
    IdentifyConfig { method: Method::Joint, air, humidity_sigma_kg_kg, ..IdentifyConfig::default() }
}

/// In the model h of moist air depends on its Prandtl number, which the convection law ignores: a third of 2.4 % of cp, absorbed by the fitted
/// coefficient. The remaining error is that of the solver.
#[test]
fn declared_humidity_gives_the_points_of_the_model() {
    let clean =
        campaign(&eighteen(), 120.0, Machine { humidity_kg_kg: HUMIDITY_KG_KG, ..Machine::default() });
    let known = identify(&clean.recording, &joint(Air::PAPER.with_humidity(HUMIDITY_KG_KG), 0.0)).unwrap();
    let dry = identify(&clean.recording, &joint(Air::PAPER, 0.0)).unwrap();
    let mut wrong = 0;
    for ((known, dry), truth) in known.iter().zip(&dry).zip(&clean.truth) {
        assert!((known.eta.unwrap() - truth.eta).abs() < 3e-4, "eta {:?} {}", known.eta, truth.eta);
        assert!(
            (known.h_w_m2k.unwrap() / truth.h_w_m2k - 1.0).abs() < 5e-3,
            "h {:?} {}",
            known.h_w_m2k,
            truth.h_w_m2k
        );
        wrong += usize::from((dry.eta.unwrap() - truth.eta).abs() > 2e-3);
    }
    assert!(wrong > clean.truth.len() / 2, "dry air is as good in all but {wrong} points");
}

/// An unknown humidity is between dry and saturated, and the intervals include it: over five draws of noise and offsets, in air of 25 degC at
/// half saturation.
#[test]
fn unknown_humidity_is_in_the_intervals() {
    let clean = campaign(&eighteen(), 120.0, Machine { humidity_kg_kg: 0.01, ..Machine::default() });
    let (mut held, mut count, mut wider) = (0, 0, [0.0; 2]);
    for seed in 0..5 {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (recording, declared) = measured(&clean.recording, 1.0, 1.0, &mut rng);
        let points = |sigma_kg_kg: f64| {
            let config = IdentifyConfig { declared: declared.clone(), ..joint(Air::PAPER, sigma_kg_kg) };
            identify(&recording, &config).unwrap()
        };
        // Saturated air has 20 g/kg.
        let (unknown, known) = (points(0.02 / 3f64.sqrt()), points(0.0));
        for ((unknown, known), truth) in unknown.iter().zip(&known).zip(&clean.truth) {
            let eta = unknown.eta_low.unwrap()..=unknown.eta_high.unwrap();
            let h = unknown.h_low_w_m2k.unwrap()..=unknown.h_high_w_m2k.unwrap();
            held += usize::from(eta.contains(&truth.eta)) + usize::from(h.contains(&truth.h_w_m2k));
            count += 2;
            wider[0] += eta.end() - eta.start() - (known.eta_high.unwrap() - known.eta_low.unwrap());
            wider[1] += h.end() - h.start() - (known.h_high_w_m2k.unwrap() - known.h_low_w_m2k.unwrap());
        }
    }
    assert!(wider.iter().all(|sum| *sum > 0.0), "{wider:?}");
    // 95 % of the points; errors of h are common to a draw, so that one draw of five may miss many.
    assert!(held * 5 >= count * 4, "{held} of {count}");
}

/// The errors that `steady` and `dynamic` state for a barometer and a humidity are those of another identification, of readings or air moved by
/// one standard deviation.
#[test]
fn single_steps_know_barometer_and_humidity() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine { humidity_kg_kg: 0.01, ..Machine::default() });
    let (pressure_pa, humidity_kg_kg) = (300.0, 0.002);
    let mut shifted = clean.recording.clone();
    for channel in [Channel::P1, Channel::P2] {
        shifted.series.get_mut(&channel).unwrap().values.iter_mut().for_each(|value| *value += pressure_pa);
    }
    let at = |humidity_kg_kg: f64, method| IdentifyConfig {
        method,
        air: Air::PAPER.with_humidity(humidity_kg_kg),
        ..IdentifyConfig::default()
    };
    for method in [Method::Steady, Method::Dynamic] {
        let config = at(0.01, method);
        let before = identify(&clean.recording, &config).unwrap();
        let barometer = IdentifyConfig { barometer_sigma_pa: pressure_pa, ..config.clone() };
        let humidity = IdentifyConfig { humidity_sigma_kg_kg: humidity_kg_kg, ..config.clone() };
        let moved = at(0.01 + humidity_kg_kg, method);
        for (stated, recording, other) in
            [(barometer, &shifted, &config), (humidity, &clean.recording, &moved)]
        {
            let (stated, other) =
                (identify(&clean.recording, &stated).unwrap(), identify(recording, other).unwrap());
            // The first step has no transient.
            for ((stated, other), before) in stated.iter().zip(&other).zip(&before).skip(1) {
                let bias = |of: &IdentifiedPoint| of.eta_uncertainty.unwrap().bias_standard_error;
                let added = (bias(stated).powi(2) - bias(before).powi(2)).sqrt();
                let change = (other.eta.unwrap() - before.eta.unwrap()).abs();
                assert!((change / added - 1.0).abs() < 0.05, "{method:?}: {change} {added}");
            }
        }
    }
}

/// A hygrometer or a dew-point mirror gives the points of the humidity that they measure: 75 % at 25 degC are 15.21 g/kg with a dew point of
/// 20.26 degC at 100 kPa (CoolProp 8, HAPropsSI).
#[test]
fn measured_humidity_replaces_the_declared_one() {
    let machine = Machine { humidity_kg_kg: 0.015_21, ..Machine::default() };
    let clean = campaign(&eighteen(), 120.0, machine);
    let known = identify(&clean.recording, &joint(Air::PAPER.with_humidity(0.015_21), 0.0)).unwrap();
    for (channel, value) in [(Channel::RelativeHumidity, 0.75), (Channel::DewPoint, 293.413)] {
        let mut recording = clean.recording.clone();
        let times = recording.series[&Channel::T1].t_s.clone();
        recording.series.insert(channel, Series { values: vec![value; times.len()], t_s: times });
        let measured = identify(&recording, &joint(Air::PAPER, 0.01)).unwrap();
        for (measured, known) in measured.iter().zip(&known) {
            assert!((measured.eta.unwrap() - known.eta.unwrap()).abs() < 1e-4, "{channel}");
        }
    }
}
