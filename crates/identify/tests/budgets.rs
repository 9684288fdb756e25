//! Uncertainty budgets: their rows combine to the stated intervals, and their sensitivities are those of the whole identification.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![allow(clippy::print_stdout, reason = "docs/validation has the table")]

use crate::lab::{Machine, campaign, eighteen, measured};
use mapper_core::{Channel, DeclaredUncertainty, Method, Recording, UncertaintyBudget, half_width_95};
use mapper_identify::{Choice, Identified, IdentifyConfig, JointSettings, identify_recording};
use mapper_numerics::parallel;
use mapper_numerics::statistics::mean;
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
        direction: Choice::Fixed,
        inlet_h: Choice::Fixed,
        ..JointSettings::default()
    }
}

fn contribution(budget: &UncertaintyBudget, source: &str) -> f64 {
    budget.rows.iter().find(|row| row.source == source).map_or(0.0, |row| row.contribution)
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
                assert!((ratio - 1.0).abs() < 0.02, "step {}: {ratio} {budget:#?}", point.step);
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
        assert!((moved / stated - 1.0).abs() < 0.02, "step {}: {moved} {stated}", known.step);
        assert!((off.eta.unwrap() - known.eta.unwrap()).abs() < 1e-6);
        assert_eq!((uncertain.eta_low, uncertain.eta_high), (known.eta_low, known.eta_high));
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
        // A wrong reading also moves the weights of the shapes that the smoothness prior averages, which are fixed in the budget: some 8 % of the
        // combined uncertainty for T2.
        let square = |values: &mut dyn Iterator<Item = f64>| {
            let squares: Vec<f64> = values.map(|value| value * value).collect();
            mean(&squares).unwrap().sqrt()
        };
        let change = square(&mut before.iter().zip(&after).map(|(a, b)| b.value - a.value));
        let stated = square(&mut before.iter().map(|budget| contribution(budget, source)));
        let combined = square(&mut before.iter().map(|budget| budget.combined_standard_uncertainty()));
        assert!((change - stated).abs() < 0.1 * combined, "{source}: {change} and {stated} of {combined}");
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

/// Draws of noise and of all declared errors, each with a whole identification, against the budgets of efficiency and h: as declared, another map
/// and law of h, moist air. `MAPPER_BUDGET_DRAWS=10000` takes that many of all three machines, for the table in docs/validation.
#[test]
fn efficiency_and_h_agree_with_draws() {
    let asked: Option<u64> = std::env::var("MAPPER_BUDGET_DRAWS").ok().map(|count| count.parse().unwrap());
    let machines = [
        Machine::default(),
        Machine { scales: [0.95, 1.04, 1.3, 0.97], ..Machine::default() },
        Machine { humidity_kg_kg: 0.02, ..Machine::default() },
    ];
    for machine in &machines[..if asked.is_some() { 3 } else { 1 }] {
        let clean = campaign(&eighteen(), 120.0, *machine).recording;
        let seeds: Vec<u64> = (0..asked.unwrap_or(12)).collect();
        let found = parallel::map(&seeds, |seed| drawn(&clean, machine.humidity_kg_kg, *seed));
        let square = |values: &[f64]| mean(values.iter().map(|value| value * value)).unwrap();
        for quantity in [0, 1] {
            let mut ratios = Vec::new();
            let (mut spread, mut stated) = (0.0, 0.0);
            for step in 0..found[0].len() {
                let of = |part: usize| -> Vec<f64> {
                    found.iter().filter_map(|steps| steps.get(step)).map(|at| at[quantity][part]).collect()
                };
                let (values, sigmas) = (of(0), of(1));
                let middle = mean(&values).unwrap();
                let around: Vec<f64> = values.iter().map(|value| value / middle - 1.0).collect();
                let relative: Vec<f64> = sigmas.iter().map(|sigma| sigma / middle).collect();
                ratios.push((square(&relative) / square(&around)).sqrt());
                (spread, stated) = (spread + square(&around), stated + square(&relative));
            }
            let whole = (stated / spread).sqrt();
            println!("{machine:?} {} stated over drawn: {whole:.3} {ratios:.3?}", ["eta", "h"][quantity]);
            // Twelve draws know their spread to a fifth.
            assert!(asked.is_some() || (whole - 1.0).abs() < 0.6, "{machine:?}: {whole} of {ratios:?}");
        }
    }
}

/// Efficiency and h of the points of one draw, each with its combined standard uncertainty.
fn drawn(clean: &Recording, humidity_kg_kg: f64, seed: u64) -> Vec<[[f64; 2]; 2]> {
    let mut random = Pcg64::seed_from_u64(3900 + seed);
    let (mut recording, mut declared) = measured(clean, 1.0, 1.0, &mut random);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let barometer_pa = BAROMETER_PA * normal();
    for (channel, gain_ratio) in
        [(Channel::P1, GAIN_RATIO), (Channel::P2, GAIN_RATIO), (Channel::CompressorFlow, 0.005)]
    {
        declared.get_mut(&channel).unwrap().gain_sigma_ratio = gain_ratio;
        let (gain, shift) = (
            1.0 + gain_ratio * normal(),
            if channel == Channel::CompressorFlow { 0.0 } else { barometer_pa },
        );
        let series = recording.series.get_mut(&channel).unwrap();
        series.values.iter_mut().for_each(|value| *value = *value * gain + shift);
    }
    let humidity_sigma_kg_kg = if humidity_kg_kg > 0.0 { HUMIDITY_SIGMA_KG_KG } else { 0.0 };
    let config = IdentifyConfig {
        method: Method::Joint,
        declared,
        barometer_sigma_pa: BAROMETER_PA,
        air: Air::PAPER.with_humidity(humidity_kg_kg + humidity_sigma_kg_kg * normal()),
        humidity_sigma_kg_kg,
        joint: if std::env::var("MAPPER_BUDGET_SEARCHED").is_ok() {
            JointSettings::default()
        } else {
            fixed()
        },
        ..IdentifyConfig::default()
    };
    let of = |budget: &Option<UncertaintyBudget>| {
        let budget = budget.as_ref().unwrap();
        [budget.value, budget.combined_standard_uncertainty()]
    };
    let found = identify_recording(&recording, &config, None).unwrap();
    found.budgets.iter().map(|point| [of(&point.eta), of(&point.h_w_m2k)]).collect()
}
