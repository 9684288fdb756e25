//! Tables of steady points, against the steady states of the model.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{
    Channel, DeclaredUncertainty, InletConvection, MeasuredPoint, Method, ModelTolerances, TurbineReadings,
};
use mapper_identify::{IdentifyConfig, KnownHeat, method_of_table, reduce};
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Steady points of a machine and their true efficiencies: five speeds, three openings, a hot turbine.
fn steady_points(params: &Params) -> Vec<(MeasuredPoint, f64)> {
    let wheel_diameter_m = params.compressor.wheel_diameter_m;
    let model = Model::new(*params, Arc::new(ClosedFormMap { wheel_diameter_m }));
    let mut points = Vec::new();
    for krpm in [50.0, 75.0, 100.0, 125.0, 150.0] {
        for valve_opening_ratio in [0.5, 0.7, 1.0] {
            let boundary = BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
            let held = hold_speed(&model, krpm * 1e3, &boundary).unwrap();
            let point = MeasuredPoint {
                line: points.len() + 2,
                speed_rpm: krpm * 1e3,
                flow_kg_s: held.outputs.flow_kg_s,
                t1_k: boundary.t1_k,
                t2_k: Some(held.outputs.t2_probe_k),
                p1_pa: boundary.p1_pa,
                p2_pa: held.state.p2_pa,
                tc_k: Some(held.state.tc_k),
                humidity_kg_kg: None,
                turbine: TurbineReadings {
                    t3_k: Some(boundary.t3_k),
                    p3_pa: Some(held.boundary.p3_pa),
                    p4_pa: Some(boundary.p4_pa),
                    oil_k: Some(boundary.oil_temperature_k),
                },
                end: None,
            };
            points.push((point, held.outputs.efficiency));
        }
    }
    points
}

fn machines() -> Vec<Params> {
    let mut machines = vec![Params::default(); 3];
    machines[1].compressor.alpha_area_ratio = 0.2;
    machines[1].compressor.inlet_convection = InletConvection::Own;
    machines[1].compressor.hot_metal_h_ratio = 1.2;
    machines[1].t2_probe_recovery_ratio = 0.8;
    machines[2].compressor.humidity_kg_kg = 0.02;
    machines[2].compressor.recirculation_ratio = 0.02;
    machines[2].compressor.efficiency = mapper_core::EfficiencyDefinition::Enthalpy;
    machines
}

fn config(params: &Params, method: Method) -> IdentifyConfig {
    IdentifyConfig { method, air: params.compressor.air(), ..IdentifyConfig::default() }
}

fn tolerances(convection_ratio: f64) -> ModelTolerances {
    ModelTolerances { convection_ratio, ..ModelTolerances::default() }
}

/// Without Tc the housings have the temperatures of their heat balance; P3 is then the one that holds the speed, if it was not measured either.
#[test]
fn t3_and_the_oil_stand_in_for_the_housing() {
    let mut machines = machines();
    machines[1].compressor.inner_capacity_ratio = 0.3;
    machines[2].radiation_area_m2 = 0.004;
    for params in machines {
        let (mut points, truth): (Vec<_>, Vec<f64>) = steady_points(&params).into_iter().unzip();
        for (index, point) in points.iter_mut().enumerate() {
            point.tc_k = None;
            if index % 2 == 0 {
                point.turbine.p3_pa = None;
            }
        }
        let known = KnownHeat {
            params: &params,
            tolerances: tolerances(0.03),
            boundary: &BoundaryConditions::default(),
            origin: "declared",
        };
        assert_eq!(method_of_table(&points, true), Method::Corrected);
        let found = reduce(&points, Some(known), &config(&params, Method::Corrected)).unwrap();
        for ((point, budget), eta) in found.iter().zip(truth) {
            assert!((point.eta.unwrap() - eta).abs() < 1e-6, "{:?} {eta}", point.eta);
            let rows = &budget.eta.as_ref().unwrap().rows;
            assert!(rows.iter().any(|row| row.source == "conduction to the oil" && row.contribution != 0.0));
        }
    }
}

#[test]
fn a_measured_housing_leads_to_the_machine_s_own_efficiencies() {
    for params in machines() {
        let (points, truth): (Vec<_>, Vec<f64>) = steady_points(&params).into_iter().unzip();
        let known = KnownHeat {
            params: &params,
            tolerances: tolerances(0.0),
            boundary: &BoundaryConditions::default(),
            origin: "declared",
        };
        assert_eq!(method_of_table(&points, true), Method::Corrected);
        let found = reduce(&points, Some(known), &config(&params, Method::Corrected)).unwrap();
        for ((point, _), eta) in found.iter().zip(truth) {
            assert!((point.eta.unwrap() - eta).abs() < 1e-8, "{:?} {eta}", point.eta);
        }
    }
}

/// The paper's definition by hand: T1 (PR^kappa - 1)/(T2 - T1); at 50 krpm heat costs points, at 150 krpm hardly any.
#[test]
fn without_it_they_are_the_conventional_ones() {
    let params = Params::default();
    let (mut points, truth): (Vec<_>, Vec<f64>) = steady_points(&params).into_iter().unzip();
    points[4].tc_k = None;
    points[4].turbine.t3_k = None;
    assert_eq!(method_of_table(&points, true), Method::Steady);
    let found = reduce(&points, None, &config(&params, Method::Steady)).unwrap();
    for ((point, _), measured) in found.iter().zip(&points) {
        let cp = 1002.5 + 275e-6 * (measured.t1_k - 200.0).powi(2);
        let ratio = measured.p2_pa / measured.p1_pa;
        let by_hand =
            measured.t1_k * (ratio.powf(287.05 / cp) - 1.0) / (measured.t2_k.unwrap() - measured.t1_k);
        assert!((point.eta.unwrap() - by_hand).abs() < 1e-12);
    }
    let low = truth[0] - found[0].0.eta.unwrap();
    assert!((0.03..0.07).contains(&low), "{low}");
}

/// Every source by itself: a table whose readings are wrong by one standard deviation has efficiencies that are wrong by its row.
#[test]
fn the_budget_predicts_the_effect_of_each_error() {
    let params = machines()[1];
    let (points, _): (Vec<_>, Vec<f64>) = steady_points(&params).into_iter().unzip();
    let error = |offset_sigma, gain_sigma_ratio| DeclaredUncertainty {
        offset_sigma,
        gain_sigma_ratio,
        noise_sigma: 0.0,
    };
    let declared = BTreeMap::from([
        (Channel::T1, error(0.25, 0.0)),
        (Channel::T2, error(0.25, 0.0)),
        (Channel::Tc, error(0.3, 0.0)),
        (Channel::P2, error(0.0, 1e-3)),
        (Channel::CompressorFlow, error(0.0, 5e-3)),
    ]);
    let config = IdentifyConfig { declared, ..config(&params, Method::Corrected) };
    let known = KnownHeat {
        params: &params,
        tolerances: tolerances(0.03),
        boundary: &BoundaryConditions::default(),
        origin: "declared",
    };
    let found = reduce(&points, Some(known), &config).unwrap();
    let etas = |points: &[MeasuredPoint], params: &Params| {
        let known = KnownHeat { params, ..known };
        let found = reduce(points, Some(known), &config).unwrap();
        found.iter().map(|(point, _)| point.eta.unwrap()).collect::<Vec<f64>>()
    };
    let before = etas(&points, &params);
    let moved = |change: fn(&mut MeasuredPoint)| {
        let mut points = points.clone();
        points.iter_mut().for_each(change);
        etas(&points, &params)
    };
    let mut warmer = params;
    warmer.compressor.nusselt_coefficient *= 1.03;
    let after = [
        ("offset of T1", moved(|point| point.t1_k += 0.25)),
        ("offset of T2", moved(|point| point.t2_k = point.t2_k.map(|t2_k| t2_k + 0.25))),
        ("offset of Tc", moved(|point| point.tc_k = point.tc_k.map(|tc_k| tc_k + 0.3))),
        ("gain of P2", moved(|point| point.p2_pa *= 1.001)),
        ("gain of m_c", moved(|point| point.flow_kg_s *= 1.005)),
        ("convection law", etas(&points, &warmer)),
    ];
    for (source, after) in &after {
        for (((_, budget), before), after) in found.iter().zip(&before).zip(after) {
            let rows = &budget.eta.as_ref().unwrap().rows;
            let row =
                rows.iter().find(|row| row.source == *source).unwrap_or_else(|| panic!("{source}: {rows:?}"));
            // One side against the mean of both sides: the difference is of second order.
            let change = after - before;
            assert!(
                (row.contribution - change).abs() < 0.05 * change.abs() + 1e-6,
                "{source}: {row:?} {change}"
            );
        }
    }
    for (point, budget) in &found {
        let budget = budget.eta.as_ref().unwrap();
        let half = 0.5 * (point.eta_high.unwrap() - point.eta_low.unwrap());
        let sum: f64 = budget.rows.iter().map(|row| row.contribution.powi(2)).sum::<f64>().sqrt();
        assert!((half / (1.96 * sum) - 1.0).abs() < 1e-3);
        assert!((point.common.eta_standard_error() / sum - 1.0).abs() < 1e-12, "all errors here are shared");
    }
}

#[test]
fn a_point_without_a_rise_has_no_efficiency_and_says_why() {
    let (mut points, _): (Vec<_>, Vec<f64>) = steady_points(&Params::default()).into_iter().unzip();
    points[0].t2_k = Some(points[0].t1_k - 1.0);
    points[1].t2_k = None;
    points[2].p2_pa = 0.99 * points[2].p1_pa;
    for method in [Method::Steady, Method::Corrected] {
        let params = Params::default();
        let known = KnownHeat {
            params: &params,
            tolerances: tolerances(0.03),
            boundary: &BoundaryConditions::default(),
            origin: "declared",
        };
        let found = reduce(&points, Some(known), &config(&params, method)).unwrap();
        for (point, _) in &found[..3] {
            assert_eq!((point.eta, point.warnings[0].code()), (None, "no_compression"), "{method}");
        }
        assert!(found[3..].iter().all(|(point, _)| point.eta.is_some()));
    }
}
