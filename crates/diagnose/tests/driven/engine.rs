//! Simulated engines with known truth: the lumped machine accelerates and brakes, and sensors measure it. The identification before the
//! brake must predict the brake.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{Channel, Recording, Series};
use mapper_diagnose::driven::{DrivenError, DrivenOutcome, Rows, identify};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::driven::{FrozenGrid, drive};
use mapper_physics::simulation::inputs::{Inputs, InterpolatedInputs};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Start of full load, and of the exhaust brake: less pressure upstream of the turbine, less air.
const LOAD_S: f64 = 6.4;
const BRAKE_S: f64 = 13.2;
const END_S: f64 = 18.0;

/// A log of a machine with its own efficiency, heat transfer, housing and probe.
fn log(seed: u64) -> (Recording, Params, Params) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = |width: f64| -> f64 {
        let z: f64 = StandardNormal.sample(&mut random);
        width * z
    };
    let declared = Params::default();
    let mut model = Model::nominal();
    let params = &mut model.params;
    params.compressor.efficiency_scale_ratio = 1.0 + normal(0.04);
    params.compressor.nusselt_coefficient *= normal(0.3).exp();
    params.compressor.housing_mass_kg *= normal(0.3).exp();
    params.compressor.alpha_area_ratio = normal(0.1).abs();
    params.t2_probe_diameter_m = 2.5e-3 * normal(0.4).exp();
    let at = |speed_rpm: f64, valve_opening_ratio: f64| {
        let boundary =
            BoundaryConditions { valve_opening_ratio, t3_k: 700.0, ..BoundaryConditions::default() };
        hold_speed(&model, speed_rpm, &boundary).unwrap()
    };
    let (idle, full, brake) = (at(50e3, 0.8), at(140e3, 0.9), at(90e3, 0.7));
    let corners_s = [0.0, LOAD_S, LOAD_S + 2.0, BRAKE_S, BRAKE_S + 0.5, END_S];
    let held = [&idle, &idle, &full, &full, &brake, &brake].map(|state| state.boundary);
    let engine = InterpolatedInputs::new(corners_s.to_vec(), held.to_vec()).unwrap();
    let times_s: Vec<f64> = (1..=(10.0 * END_S) as usize).map(|i| 0.1 * i as f64).collect();
    let grid = FrozenGrid::new(0.0, END_S, &corners_s, &times_s);
    let channels =
        [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::P2, Channel::T1, Channel::T2];
    let mut columns = vec![Vec::new(); channels.len()];
    let (flow_gain, t2_offset_k) = (1.0 + normal(0.01), normal(0.5));
    let mut noise = Pcg64Mcg::seed_from_u64(seed + 1000);
    drive(&model, &engine, idle.state, &grid, &times_s, |i, _, state, outputs| {
        let mut white = |sigma: f64| -> f64 {
            let z: f64 = StandardNormal.sample(&mut noise);
            sigma * z
        };
        let boundary = engine.at(times_s[i]);
        let row = [
            state.shaft_speed_rpm() + white(50.0),
            flow_gain * outputs.flow_kg_s + white(2e-4),
            boundary.p1_pa + white(50.0),
            state.p2_pa + white(100.0),
            boundary.t1_k + white(0.1),
            outputs.t2_probe_k + t2_offset_k + white(0.1),
        ];
        for (column, value) in columns.iter_mut().zip(row) {
            column.push(value);
        }
    })
    .unwrap();
    let series = channels.into_iter().zip(columns);
    let series = series.map(|(channel, values)| (channel, Series { t_s: times_s.clone(), values })).collect();
    (Recording { series, ..Recording::default() }, declared, model.params)
}

#[test]
fn what_is_left_of_the_brake_is_what_was_expected() {
    let (recording, declared, truth) = log(0);
    let outcome: DrivenOutcome =
        identify(&Rows::of_compressor(&recording).unwrap(), declared, BRAKE_S, 1).unwrap();
    let h = truth.compressor.nusselt_coefficient / declared.compressor.nusselt_coefficient;
    for (name, truth) in [("probe", 1e3 * truth.t2_probe_diameter_m), ("h", h)] {
        let found = outcome.parameters.iter().find(|found| found.parameter.name == name).unwrap();
        assert!((found.low..=found.high).contains(&truth), "{name} {truth}: {found:?}");
    }
    let judged = outcome.held_out.unwrap();
    assert!((judged.expected_low_k..=judged.expected_high_k).contains(&judged.rms_k), "{judged:?}");
    assert!(judged.inside_ratio > 0.85, "{judged:?}");
}

/// A day at 10 Hz is read completely, but thinned to the maximum number of rows of a sample.
#[test]
fn a_long_log_is_thinned() {
    let (mut recording, ..) = log(0);
    for series in recording.series.values_mut() {
        series.t_s = (0..864_000).map(|i| 0.1 * f64::from(i)).collect();
        series.values = vec![series.values[0]; series.t_s.len()];
    }
    let rows = Rows::of_compressor(&recording).unwrap();
    assert!((2_000..=3_001).contains(&rows.len()), "{}", rows.len());
    assert!(rows.t_s.last().unwrap() > &86_000.0);
}

#[test]
fn too_little_is_refused() {
    let (recording, declared, _) = log(0);
    let rows = Rows::of_compressor(&recording).unwrap();
    assert!(matches!(identify(&rows, declared, 1.0, 1), Err(DrivenError::TooFewRows { rows: 9, .. })));
    let mut without = recording;
    without.series.remove(&Channel::P2);
    assert!(matches!(Rows::of_compressor(&without), Err(DrivenError::Channel(_))));
}
