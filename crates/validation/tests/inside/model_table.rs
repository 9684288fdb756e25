//! The figures that an independent implementation found with this model (`docs/reference/model.md`): 4 jumps at
//! openings 0.5, 0.7 and 1.0, noise-free, 10 to 110 s, errors against the mean in the window unless stated otherwise.
//! Tolerances are half the last printed digit.

use crate::reproduction::figures::figure_5::apparent_eta;
use crate::reproduction::lab::{
    Outcome, RUN_S, Run, WINDOW, dynamic_config, extremes, identify_runs, run_all, truth_in_window, worst,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;

fn runs(machine: &Model) -> Vec<Run> {
    let runs = run_all(machine, RUN_S).unwrap();
    runs.into_iter().filter(|run| run.jump.opening <= 1.0).collect()
}

fn spread(run: &Run, value: fn(&crate::reproduction::lab::Truth) -> f64) -> f64 {
    let (low, high) = extremes(truth_in_window(run, &WINDOW).iter().map(|truth| Some(value(truth)))).unwrap();
    high - low
}

#[test]
fn the_dynamic_method_agrees_with_the_reference() {
    let runs = runs(&Model::nominal());
    assert_eq!(runs.len(), 12);
    let results = identify_runs(&runs, &dynamic_config(0.0)).unwrap();
    assert!((worst(results.iter().map(Outcome::eta_error_points)) - 1.0).abs() < 0.05);
    assert!((worst(results.iter().map(Outcome::eta_end_error_points)) - 1.1).abs() < 0.05);
    let small = results.iter().filter(|o| o.eta_error_points().unwrap().abs() < 0.3).count();
    assert!(2 * small > results.len(), "most below 0.3 points, {small} are");
    let (low, high) = extremes(results.iter().map(Outcome::h_error_percent)).unwrap();
    assert!((low + 3.0).abs() < 0.5 && (high - 9.0).abs() < 0.5, "h {low} to {high} %");
    let (low, high) = extremes(runs.iter().map(|run| Some(spread(run, |t| t.t2_k)))).unwrap();
    assert!((low - 10.0).abs() < 0.05 && (high - 25.3).abs() < 0.05, "T2 moves {low} to {high} K");
}

#[test]
fn the_operating_point_drifts_as_in_the_reference() {
    let runs = runs(&Model::nominal());
    for (value, low_percent, high_percent) in [
        ((|t| t.speed_rpm) as fn(&crate::reproduction::lab::Truth) -> f64, 0.4, 0.7),
        (|t| t.pressure_ratio, 0.1, 1.2),
        (|t| t.flow_kg_s, 0.9, 2.2),
    ] {
        let relative = |run: &Run| 100.0 * spread(run, value) / value(&truth_in_window(run, &WINDOW)[0]);
        let (low, high) = extremes(runs.iter().map(|run| Some(relative(run)))).unwrap();
        // The reference of the drift (start, mean, end) changes it by some percent.
        assert!((low - low_percent).abs() < 0.1 && (high - high_percent).abs() < 0.1, "{low} to {high} %");
    }
}

#[test]
fn steady_hot_mapping_agrees_with_the_reference() {
    let model = Model::nominal();
    let errors = [0.5, 0.7, 1.0].map(|valve_opening_ratio| {
        let boundary = BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
        let steady = hold_speed(&model, 50e3, &boundary).unwrap();
        Some(100.0 * (apparent_eta(&steady) - steady.outputs.efficiency))
    });
    let (low, high) = extremes(errors).unwrap();
    assert!((low + 5.1).abs() < 0.05 && (high + 4.3).abs() < 0.05, "{low} to {high} points");
}

#[test]
fn a_wrong_area_split_costs_what_it_costs_in_the_reference() {
    let mut machine = Model::nominal();
    machine.params.compressor.alpha_area_ratio = 0.2;
    let runs = runs(&machine);
    let wrong = identify_runs(&runs, &dynamic_config(0.0)).unwrap();
    let (low, high) = extremes(wrong.iter().map(|o| o.eta_error_points().map(f64::abs))).unwrap();
    assert!((low - 9.0).abs() < 0.5 && (high - 15.0).abs() < 0.5, "{low} to {high} points");
    let right = identify_runs(&runs, &dynamic_config(0.2)).unwrap();
    assert!(worst(right.iter().map(Outcome::eta_error_points)) < 1.2);
}

#[test]
fn a_probe_of_1_5_mm_costs_what_it_costs_in_the_reference() {
    let mut machine = Model::nominal();
    machine.params.t2_probe_diameter_m = 1.5e-3;
    let results = identify_runs(&runs(&machine), &dynamic_config(0.0)).unwrap();
    assert!((worst(results.iter().map(Outcome::eta_error_points)) - 0.6).abs() < 0.05);
}
