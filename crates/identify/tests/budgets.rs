//! Uncertainty budgets: their rows combine to the stated intervals, and their sensitivities are those of the whole identification.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![allow(clippy::print_stdout, reason = "docs/validation has the table")]

use crate::lab::{Machine, campaign, eighteen, measured};
use mapper_core::{
    Channel, DeclaredUncertainty, IdentifiedPoint, Method, Recording, UncertaintyBudget, half_width_95,
};
use mapper_identify::{Choice, Identified, IdentifyConfig, JointSettings, identify_recording};
use mapper_numerics::parallel;
use mapper_numerics::statistics::{mean, rms};
use mapper_physics::gas::air::Air;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;

const GAIN_RATIO: f64 = 5.8e-4;
const BAROMETER_PA: f64 = 300.0;

fn recorded() -> (Recording, BTreeMap<Channel, DeclaredUncertainty>) {
    let clean = campaign(&eighteen(), 120.0, Machine::default());
    let (recording, mut declared) = measured(&clean.recording, 1.0, 1.0, &mut Pcg64::seed_from_u64(3800));
    for channel in [Channel::P1, Channel::P2] {
        declared.get_mut(&channel).unwrap().gain_sigma_ratio = GAIN_RATIO;
    }
    declared.get_mut(&Channel::CompressorFlow).unwrap().gain_sigma_ratio = 0.005;
    (recording, declared)
}

fn identified(
    recording: &Recording,
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
    joint: JointSettings,
) -> Identified {
    let config = IdentifyConfig {
        method: Method::Joint,
        declared: declared.clone(),
        barometer_sigma_pa: BAROMETER_PA,
        joint,
        ..IdentifyConfig::default()
    };
    identify_recording(recording, &config, None).unwrap()
}

/// Parameters with a prior are fixed: their selection is not linear in the readings.
fn fixed() -> JointSettings {
    JointSettings {
        alpha_area: Choice::Fixed,
        probe: Choice::Fixed,
        heating_cooling_ratio: Choice::Fixed,
        inlet_h: Choice::Fixed,
        ..JointSettings::default()
    }
}

fn contribution(budget: &UncertaintyBudget, source: &str) -> f64 {
    budget.rows.iter().find(|row| row.source == source).map_or(0.0, |row| row.contribution)
}

/// Means over half a second have less noise than samples; what a fit leaves beyond it is the noise of the smoothed inputs.
#[test]
fn the_fit_of_each_point_leaves_no_more_than_the_noise() {
    let (recording, declared) = recorded();
    let found = identified(&recording, &declared, JointSettings::default());
    assert_eq!(found.fitted.len(), recording.steps.len());
    for (step, fitted) in &found.fitted {
        let channels: Vec<Channel> = fitted.iter().map(|one| one.channel).collect();
        assert_eq!(channels, [Channel::T2, Channel::Tc], "{step}");
        for one in fitted {
            let left = one.read_k.iter().zip(&one.fitted_k).map(|(read, fitted)| read - fitted);
            let (left_k, noise_k) = (rms(left).unwrap(), declared[&one.channel].noise_sigma);
            assert!(left_k < 2.5 * noise_k, "{step} {:?}: {left_k} K of {noise_k} K", one.channel);
        }
    }
}

#[test]
fn rows_combine_to_the_stated_uncertainty() {
    let (recording, declared) = recorded();
    for joint in [JointSettings::default(), fixed()] {
        let found = identified(&recording, &declared, joint);
        assert_eq!(found.budgets.len(), 18);
        for (point, budgets) in found.points.iter().flatten().zip(&found.budgets) {
            assert_eq!(point.step, budgets.step);
            for budget in [budgets.eta.as_ref().unwrap(), budgets.h_w_m2k.as_ref().unwrap()] {
                let combined = half_width_95(budget.combined_standard_uncertainty());
                let ratio = combined / budget.expanded_uncertainty;
                // An interval of ln h that reaches far to one side is narrower in h: 5 % where it reaches a tenth of h.
                assert!((ratio - 1.0).abs() < 0.05, "step {}: {ratio} {budget:#?}", point.step);
                for source in ["offset of T2", "gain of P2", "barometer", "gain of m_c"] {
                    assert!(budget.rows.iter().any(|row| row.source == source), "{source} in {budget:#?}");
                }
            }
            // No source of these pressures is below half a per mille.
            assert!(budgets.pressure_ratio.expanded_uncertainty > 1e-3 * point.pressure_ratio);
        }
    }
}

/// The same recording identified with an area that is off by its standard uncertainty has other h by the contribution, and equal efficiencies.
#[test]
fn an_uncertain_area_is_in_h_alone() {
    let (recording, declared) = recorded();
    let with = |internal_area_m2: f64, internal_area_sigma_ratio: f64| {
        let usual = IdentifyConfig::default();
        let config = IdentifyConfig {
            method: Method::Joint,
            declared: declared.clone(),
            joint: fixed(),
            internal_area_m2: usual.internal_area_m2 * internal_area_m2,
            internal_area_sigma_ratio,
            ..usual
        };
        identify_recording(&recording, &config, None).unwrap()
    };
    let sigma_ratio = 0.01;
    let (known, uncertain, off) = (with(1.0, 0.0), with(1.0, sigma_ratio), with(1.0 + sigma_ratio, 0.0));
    let points = |found: &Identified| found.points.iter().flatten().cloned().collect::<Vec<_>>();
    for (((known, uncertain), off), budgets) in
        points(&known).iter().zip(points(&uncertain)).zip(points(&off)).zip(&uncertain.budgets)
    {
        let moved = off.h_w_m2k.unwrap() - known.h_w_m2k.unwrap();
        let stated = contribution(budgets.h_w_m2k.as_ref().unwrap(), "internal area");
        // 1 / 1.01 is not quite 0.99.
        assert!((moved.abs() / stated.abs() - 1.0).abs() < 0.02, "step {}: {moved} {stated}", known.step);
        assert!((off.eta.unwrap() - known.eta.unwrap()).abs() < 1e-4);
        let ends = |point: &IdentifiedPoint| point.eta_low.zip(point.eta_high).unwrap();
        let (with_area, without) = (ends(&uncertain), ends(known));
        assert!((with_area.0 - without.0).abs() < 1e-4 && (with_area.1 - without.1).abs() < 1e-4);
        assert!(uncertain.h_high_w_m2k > known.h_high_w_m2k);
    }
}

/// A reading that is off by its standard uncertainty moves the efficiencies by the contribution: the whole identification is made again.
#[test]
fn sensitivities_are_those_of_another_identification() {
    let (recording, declared) = recorded();
    let sources: [(&str, &[Channel], f64, f64); 8] = [
        ("offset of T1", &[Channel::T1], 0.25, 0.0),
        ("offset of T2", &[Channel::T2], 0.25, 0.0),
        ("offset of Tc", &[Channel::Tc], 0.3, 0.0),
        ("offset of P1", &[Channel::P1], 50.0, 0.0),
        ("offset of P2", &[Channel::P2], 100.0, 0.0),
        ("gain of P2", &[Channel::P2], 0.0, GAIN_RATIO),
        ("gain of m_c", &[Channel::CompressorFlow], 0.0, 0.005),
        ("barometer", &[Channel::P1, Channel::P2], BAROMETER_PA, 0.0),
    ];
    let base = identified(&recording, &declared, fixed());
    let moved = parallel::map(&sources, |(_, channels, offset, gain)| {
        let mut other = recording.clone();
        for channel in *channels {
            let series = other.series.get_mut(channel).unwrap();
            series.values.iter_mut().for_each(|value| *value += offset + gain * *value);
        }
        identified(&other, &declared, fixed())
    });
    for ((source, ..), other) in sources.iter().zip(&moved) {
        let of =
            |found: &Identified| found.budgets.iter().map(|one| one.eta.clone().unwrap()).collect::<Vec<_>>();
        let (before, after) = (of(&base), of(other));
        // A whole standard uncertainty of T2 is 2 % of the rise at 50 krpm, and T1 moves the weight of preheating: the budget is linear to 5 %.
        let square = |values: &mut dyn Iterator<Item = f64>| {
            let squares: Vec<f64> = values.map(|value| value * value).collect();
            mean(&squares).unwrap().sqrt()
        };
        let change = square(&mut before.iter().zip(&after).map(|(a, b)| b.value - a.value));
        let stated = square(&mut before.iter().map(|budget| contribution(budget, source)));
        let combined = square(&mut before.iter().map(|budget| budget.combined_standard_uncertainty()));
        assert!((change - stated).abs() < 0.05 * combined, "{source}: {change} and {stated} of {combined}");
    }
}

/// Ten thousand draws of the declared errors of both pressures against the budget of the pressure ratio.
#[test]
fn the_pressure_ratio_agrees_with_draws() {
    let (recording, declared) = recorded();
    let found = identified(&recording, &declared, fixed());
    let mut random = Pcg64::seed_from_u64(3801);
    for (point, budgets) in found.points.iter().flatten().zip(&found.budgets) {
        let (p1_pa, p2_pa) = (point.p1_pa, point.p1_pa * point.pressure_ratio);
        let draws: Vec<f64> = (0..10_000)
            .map(|_| {
                let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
                let barometer = BAROMETER_PA * normal();
                let p1 = p1_pa * (1.0 + GAIN_RATIO * normal()) + 50.0 * normal() + barometer;
                let p2 = p2_pa * (1.0 + GAIN_RATIO * normal()) + 100.0 * normal() + barometer;
                p2 / p1
            })
            .collect();
        let middle = mean(&draws).unwrap();
        let squares: Vec<f64> = draws.iter().map(|draw| (draw - middle).powi(2)).collect();
        let ratio = mean(&squares).unwrap().sqrt() / budgets.pressure_ratio.combined_standard_uncertainty();
        assert!((ratio - 1.0).abs() < 0.05, "step {}: {ratio}", point.step);
    }
}

/// Standard uncertainty of a humidity: 2.5 % of relative humidity at 35 degC are 0.9 g/kg, at 40 degC 1.2.
const HUMIDITY_SIGMA_KG_KG: f64 = 1.25e-3;

/// Standard uncertainty of the loss of efficiency at low speed, as the joint method assumes it.
const LOW_SPEED_LOSS: f64 = 0.01;

/// Errors of efficiency and h over draws of all sources, each a run and an identification, against the budgets: the nominal machine, another size,
/// map and climate, and moist air. `MAPPER_BUDGET_DRAWS=1000` takes that many of all three machines, for the table in docs/validation.
#[test]
fn efficiency_and_h_agree_with_draws() {
    let asked: Option<u64> = std::env::var("MAPPER_BUDGET_DRAWS").ok().map(|count| count.parse().unwrap());
    let scales = [0.95, 1.04, 1.3, 0.97];
    let machines = [
        Machine::default(),
        Machine { size: 1.4, scales, choke_loss: 0.1, inlet_air: (85e3, 308.15), ..Machine::default() },
        Machine { size: 0.8, choke_loss: 0.05, humidity_kg_kg: 0.02, ..Machine::default() },
    ];
    for machine in &machines[..if asked.is_some() { 3 } else { 1 }] {
        let seeds: Vec<u64> = (0..asked.unwrap_or(12)).collect();
        let found: Vec<Vec<[[f64; 2]; 2]>> = parallel::map(&seeds, |seed| drawn(machine, *seed));
        let square = |quantity: usize, part: usize, steps: &[usize]| -> f64 {
            let of_draw = |draw: &Vec<[[f64; 2]; 2]>| {
                mean(steps.iter().map(|step| draw[*step][quantity][part].powi(2)))
            };
            mean(found.iter().filter_map(of_draw)).unwrap()
        };
        let all: Vec<usize> = (0..18).collect();
        for quantity in [0, 1] {
            let ratio = |steps: &[usize]| (square(quantity, 1, steps) / square(quantity, 0, steps)).sqrt();
            let ratios: Vec<f64> = all.iter().map(|step| ratio(&[*step])).collect();
            let (whole, error) = (ratio(&all), square(quantity, 0, &all).sqrt());
            println!(
                "{machine:?} {} stated over drawn: {whole:.3} of {error:.5}, {ratios:.3?}",
                ["eta", "h"][quantity]
            );
            // Twelve draws know their spread to a fifth.
            assert!(asked.is_some() || (whole - 1.0).abs() < 0.6, "{machine:?}: {whole} of {ratios:?}");
        }
    }
}

/// Efficiency (fraction) and h (ratio) of the points of one draw: error and combined standard uncertainty.
fn drawn(machine: &Machine, seed: u64) -> Vec<[[f64; 2]; 2]> {
    let mut random = Pcg64::seed_from_u64(3900 + seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let clean =
        campaign(&eighteen(), 120.0, Machine { low_speed_loss: LOW_SPEED_LOSS * normal(), ..*machine });
    let barometer_pa = BAROMETER_PA * normal();
    let gains = [(Channel::P1, GAIN_RATIO), (Channel::P2, GAIN_RATIO), (Channel::CompressorFlow, 0.005)]
        .map(|(channel, ratio)| (channel, ratio, 1.0 + ratio * normal()));
    let humidity_sigma_kg_kg = if machine.humidity_kg_kg > 0.0 { HUMIDITY_SIGMA_KG_KG } else { 0.0 };
    let humidity_kg_kg = machine.humidity_kg_kg + humidity_sigma_kg_kg * normal();
    let (mut recording, mut declared) = measured(&clean.recording, 1.0, 1.0, &mut random);
    for (channel, ratio, gain) in gains {
        declared.get_mut(&channel).unwrap().gain_sigma_ratio = ratio;
        let shift_pa = if channel == Channel::CompressorFlow { 0.0 } else { barometer_pa };
        let series = recording.series.get_mut(&channel).unwrap();
        series.values.iter_mut().for_each(|value| *value = *value * gain + shift_pa);
    }
    let usual = IdentifyConfig::default();
    let config = IdentifyConfig {
        method: Method::Joint,
        declared,
        barometer_sigma_pa: BAROMETER_PA,
        air: Air::PAPER.with_humidity(humidity_kg_kg),
        humidity_sigma_kg_kg,
        internal_area_m2: usual.internal_area_m2 * machine.size.powi(2),
        inlet_diameter_m: usual.inlet_diameter_m * machine.size,
        outlet_diameter_m: usual.outlet_diameter_m * machine.size,
        joint: fixed(),
        ..usual
    };
    let of = |budget: &Option<UncertaintyBudget>, truth: f64, unit: f64| {
        let budget = budget.as_ref().unwrap();
        [(budget.value - truth) / unit, budget.combined_standard_uncertainty() / unit]
    };
    let found = identify_recording(&recording, &config, None).unwrap();
    let of_points = found.budgets.iter().zip(&clean.truth);
    of_points
        .map(|(point, truth)| {
            [of(&point.eta, truth.eta, 1.0), of(&point.h_w_m2k, truth.h_w_m2k, truth.h_w_m2k)]
        })
        .collect()
}
