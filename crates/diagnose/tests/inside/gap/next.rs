//! Expected results of experiments, on recordings of the adaptive simulator.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::best_fit::fit::Fit;
use crate::gap::diagnose::{Diagnosed, gap};
use crate::gap::experiment::{AllowedJump, AlsoChanged, AtRest, Experiment};
use crate::gap::next_experiment::{Rivals, Suggested, next, separation};
use crate::gap::report::{Kind, Next};
use crate::inside::gap::common::{self, Visits, boundary, declared};
use mapper_core::{Channel, OperatingPoint, Recording, StepKind, StepMarker};
use mapper_observe::averages::Table;
use mapper_observe::model_inputs::lagged_command::Response;
use mapper_observe::model_inputs::smoothed_inputs::SmoothedInputs;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::{Inputs, hold_speed};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Four steps, after which heat to the oil and heat to the cell are hardly distinguishable.
const VISITS: Visits = Visits { speeds_rpm: &[90e3, 130e3, 70e3, 110e3], dwell_s: 120.0 };

fn ask(truth: (&str, f64), candidates: &[&str]) -> Diagnosed {
    let mut rig = Rig::new(Model::nominal());
    add(&mut rig, mapper_effects::find(truth.0).unwrap().as_ref(), &[truth.1]).unwrap();
    let recording = common::record_of(&rig, &VISITS, 3);
    let effects = common::effects(candidates);
    gap(common::request(&recording, common::declared(), Model::nominal(), effects)).unwrap()
}

fn point(speed_rpm: f64) -> OperatingPoint {
    OperatingPoint { speed_rpm, valve_opening_ratio: 0.9 }
}

fn held_pa(speed_rpm: f64, boundary: &BoundaryConditions) -> f64 {
    hold_speed(&Model::nominal(), speed_rpm, boundary).unwrap().boundary.p3_pa
}

fn jump(from_rpm: f64, to_rpm: f64, dwell_s: f64) -> Experiment {
    Experiment::jump(AllowedJump {
        from: point(from_rpm),
        to: point(to_rpm),
        from_p3_pa: held_pa(from_rpm, &boundary()),
        to_p3_pa: held_pa(to_rpm, &boundary()),
        dwell_s,
    })
}

fn oil_step(speed_rpm: f64, by_k: f64) -> Experiment {
    let from_k = boundary().oil_temperature_k;
    let to_k = from_k + by_k;
    let mut experiment = jump(speed_rpm, speed_rpm, 300.0);
    experiment.jump.to_p3_pa =
        held_pa(speed_rpm, &BoundaryConditions { oil_temperature_k: to_k, ..boundary() });
    Experiment { also: AlsoChanged::Oil { from_k, to_k }, ..experiment }
}

fn fit_of<'a>(diagnosed: &'a Diagnosed, id: &str) -> &'a Fit {
    let is_it = |fit: &&Fit| {
        let [(index, _)] = fit.hypothesis.effects.as_slice() else { return false };
        diagnosed.study.effects[*index].info().id == id
    };
    diagnosed.library.as_ref().unwrap().fits.iter().find(is_it).unwrap()
}

/// Heat to the oil or to the cell: an oil step changes the driving temperature of only one of them.
#[test]
fn an_oil_step_tells_an_oil_side_pair_apart_and_a_lag_from_nothing() {
    let diagnosed = ask(("ventilation", 2.0), &["ventilation", "oil_scale"]);
    let pair = [fit_of(&diagnosed, "ventilation"), fit_of(&diagnosed, "oil_scale")];
    let nearest = |experiment: &Experiment, pair: &[&Fit; 2], of: &Diagnosed| {
        let separation = separation(&of.study, experiment, pair).unwrap();
        assert!(separation[0][0].abs() < 1e-9 && separation[1][1].abs() < 1e-9, "from itself nothing");
        separation[0][1].min(separation[1][0])
    };
    let step = nearest(&oil_step(70e3, 40.0), &pair, &diagnosed);
    let small = nearest(&oil_step(70e3, 4.0), &pair, &diagnosed);
    let none = nearest(&oil_step(70e3, 0.0), &pair, &diagnosed);
    assert!(step > 3.0 * none && small < 0.5 * step, "{step} {small} {none}");

    // Lag of a probe and of a meter: neither is visible without fast changes.
    let diagnosed = ask(("tip_diameter", 1e-3), &["tip_diameter", "stem_conduction"]);
    let pair = [fit_of(&diagnosed, "tip_diameter"), fit_of(&diagnosed, "stem_conduction")];
    let step = nearest(&oil_step(70e3, 40.0), &pair, &diagnosed);
    let jumped = nearest(&jump(60e3, 140e3, 60.0), &pair, &diagnosed);
    assert!(step < 0.1 * jumped, "{step} {jumped}");
}

/// At rest T1, T2 and Tc read the same apart from their offsets.
#[test]
fn a_more_uniform_soak_gives_more_information() {
    let soak = |left_k: f64| {
        let soak = AtRest { duration_s: 1800.0, left_sigma_k: [left_k; AtRest::CHANNELS.len()] };
        Experiment { also: AlsoChanged::Soak(soak), ..jump(70e3, 70e3, 300.0) }
    };
    let diagnosed = ask(("t2_offset", 2.0), &["t1_offset", "t2_offset"]);
    let pair = [fit_of(&diagnosed, "t2_offset"), fit_of(&diagnosed, "t1_offset")];
    let information = |left_k: f64| separation(&diagnosed.study, &soak(left_k), &pair).unwrap();
    // A more uniform soak gives more information; the common temperature stays unknown, and a cause does not differ from itself.
    let [even, uneven, useless] = [0.02, 0.3, 100.0].map(|left_k| information(left_k)[0][1]);
    assert!(
        information(0.02)[0][0].abs() < 1e-9 && even > uneven && uneven > useless,
        "{even} {uneven} {useless}"
    );
    assert!(useless < 0.01, "sensors that rest unevenly by 100 K give no information: {useless}");
}

/// The list is ranked by information per minute, its first entry is `next`, and it contains only allowed experiments.
#[test]
fn what_is_offered_is_ranked_and_the_first_is_next() {
    let offered =
        vec![jump(70e3, 110e3, 60.0), jump(90e3, 91e3, 60.0), oil_step(70e3, 40.0), oil_step(70e3, 0.01)];
    let diagnosed = ask(("ventilation", 2.0), &["ventilation", "oil_scale"]);
    let rivals = Rivals {
        fits: vec![fit_of(&diagnosed, "ventilation"), fit_of(&diagnosed, "oil_scale")],
        probabilities: vec![0.5, 0.4],
    };
    let Suggested { next, experiments } = next(&diagnosed.study, rivals, &offered, 1.0);
    let rates: Vec<f64> = experiments.iter().map(|e| e.entropy_drop_bit / e.minutes).collect();
    assert!(rates.len() >= 2 && rates.is_sorted_by(|a, b| a >= b), "{rates:?}");
    assert!(experiments.iter().all(|e| (0.0..=1.0).contains(&e.probability_settled)));
    let Some(Next::Jump { minutes, expected_probability, .. }) = next else { panic!("{next:?}") };
    let first = &experiments[0];
    assert_eq!((minutes, expected_probability), (first.minutes, first.expected_probability));
    let oil = experiments.iter().find(|e| e.kind == Kind::OilStep).unwrap();
    let from_k = boundary().oil_temperature_k;
    assert_eq!(oil.oil_temperature_k, Some([from_k, from_k + 40.0]));
    assert!(oil.script[1].starts_with("oil("), "{:?}", oil.script);
    assert!(experiments.iter().all(|e| e.kind != Kind::T3Step));
}

/// Distance of the smoothed T3 or oil history from the true step, with and without noise.
#[test]
fn the_smoother_follows_a_step_of_t3_and_oil() {
    let t_s: Vec<f64> = (0..6_000).map(|i| 0.1 * f64::from(i)).collect();
    let (t3_k, oil_k) = (boundary().t3_k, boundary().oil_temperature_k);
    let hold = jump(70e3, 70e3, 300.0);
    let steps: Vec<StepMarker> = (0..2)
        .map(|index| StepMarker {
            index,
            kind: StepKind::Point,
            start_s: 300.0 * index as f64,
            end_s: 300.0 * (index + 1) as f64,
            from: None,
            to: None,
            p3_pa: hold.jump.to_p3_pa,
            valve_opening_ratio: 0.9,
        })
        .collect();
    // Of 100 K of T3 and 40 K of oil, at most this much is lost around the corner.
    for (change, most_k) in [
        (AlsoChanged::T3 { from_k: t3_k, to_k: t3_k - 100.0 }, 4.0),
        (AlsoChanged::Oil { from_k: oil_k, to_k: oil_k + 40.0 }, 1.5),
    ] {
        let (channel, series) = Experiment { also: change, ..hold }.driven(&t_s, 300.0).unwrap();
        for noise_k in [0.0, declared().noise_sigma(channel)] {
            let mut random = Pcg64::seed_from_u64(5);
            let mut noisy = series.clone();
            for value in &mut noisy.values {
                let noise: f64 = random.sample(StandardNormal);
                *value += noise_k * noise;
            }
            let recording =
                Recording { series: [(channel, noisy)].into(), steps: steps.clone(), ..Recording::default() };
            let table = Table::new(&recording).unwrap();
            let lags = (Response::lag(0.3), Response::lag(0.0));
            let inputs = SmoothedInputs::read(&table, &recording, &declared(), lags);
            let read = |t: f64| {
                let at = inputs.at(t);
                if channel == Channel::T3 { at.t3_k } else { at.oil_temperature_k }
            };
            let off = t_s.iter().zip(&series.values).map(|(t, v)| (read(*t) - v).abs());
            let worst_k = off.fold(0.0, f64::max);
            assert!(worst_k < most_k, "{channel:?}, noise {noise_k} K: {worst_k} K");
        }
    }
}
