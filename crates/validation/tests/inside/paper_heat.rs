//! The heat of the paper's machine, which the paper does not print.

use crate::reproduction::figures::figure_5::hot_error_points;
use crate::reproduction::lab::{OPENINGS, paper_machine};
use mapper_physics::simulation::model::Model;
use std::path::Path;

/// Largest apparent minus true efficiency at 90 and 110 krpm, and the mean at 150 krpm, points.
fn signs(machine: &Model) -> (f64, f64) {
    let errors = |speed: f64| OPENINGS.map(|opening| hot_error_points(machine, speed, opening).unwrap());
    let highest = errors(90e3).into_iter().chain(errors(110e3)).fold(f64::NEG_INFINITY, f64::max);
    (highest, errors(150e3).iter().sum::<f64>() / OPENINGS.len() as f64)
}

/// The fit. Friction of a kilowatt at 150 krpm, the largest that is usual for bearings of this size; then the largest whole conductance to
/// the oil at which hot steady mapping is low by at least 0.1 points at 90 and 110 krpm and not at 150 krpm (section 5.3). More heat would miss the
/// 5 points at 50 krpm (section 5.1) by more.
#[test]
fn the_paper_s_heat_has_the_signs_of_figures_5_and_11() {
    let machine = paper_machine();
    assert!((machine.params.bearing.friction_heat_w * 1.5f64.powi(2) - 1e3).abs() < 20.0);
    let (highest, at_150) = signs(&machine);
    assert!(highest < -0.1 && at_150 > 0.0, "{highest} and {at_150} points");
    let mut cooler = machine.clone();
    cooler.params.bearing.oil_conductance_w_k += 1.0;
    assert!(signs(&cooler).0 > -0.1);
    let slow = [0.5, 0.7, 1.0].map(|opening| hot_error_points(&machine, 50e3, opening).unwrap());
    assert!(slow.iter().all(|error| (-8.0..-4.0).contains(error)), "{slow:?}");
}

#[test]
fn the_shipped_campaign_has_this_machine() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/turbo_paper.yaml");
    let campaign = mapper_campaign::load(&path).unwrap_or_else(|error| panic!("{error}"));
    let (mut params, expected) = (campaign.machine.params, paper_machine().params);
    // The campaign declares the humidity of its cell.
    params.compressor.humidity_kg_kg = expected.compressor.humidity_kg_kg;
    params.t2_probe_diameter_m = campaign.sensors[&mapper_core::Channel::T2].probe_diameter_m;
    assert_eq!(params, expected);
}
