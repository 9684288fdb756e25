//! Boundary conditions that vary in time: interpolated tables, and events on the way.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{Model, State};
use mapper_physics::simulation::simulate::{Crossing, ModelEvent, Simulator, Watch};
use mapper_physics::simulation::steady;
use mapper_physics::simulation::steady::{InputsError, InterpolatedInputs};

fn held(speed_rpm: f64, valve_opening_ratio: f64) -> steady::SteadyState {
    let boundary = BoundaryConditions { valve_opening_ratio, ..Default::default() };
    steady::hold_speed(&Model::nominal(), speed_rpm, &boundary).unwrap()
}

/// A ramp of P3 from the hold of 70 krpm to that of 110 krpm over 20 s, as a table with `rows` intervals.
fn ramp(rows: u32) -> InterpolatedInputs {
    let (from, to) = (held(70e3, 0.7).boundary, held(110e3, 0.7).boundary);
    let shares: Vec<f64> = (0..=rows).map(|i| f64::from(i) / f64::from(rows)).collect();
    let row =
        |share: &f64| BoundaryConditions { p3_pa: from.p3_pa + share * (to.p3_pa - from.p3_pa), ..from };
    InterpolatedInputs::new(
        shares.iter().map(|share| 20.0 * share).collect(),
        shares.iter().map(row).collect(),
    )
    .unwrap()
}

fn end_of(inputs: &InterpolatedInputs, watch: Watch) -> (State, Vec<ModelEvent>) {
    let model = Model::nominal();
    let mut simulator = Simulator::new(&model, 0.0, held(70e3, 0.7).state, 1e-8, watch);
    let mut events = Vec::new();
    simulator.run_to(60.0, inputs, [], |_, _, _| {}, |event| events.push(event)).unwrap();
    (simulator.state(), events)
}

/// A straight line is the same line with two rows or with two hundred; only the number of kinks differs.
#[test]
fn more_rows_of_the_same_ramp_change_nothing() {
    let ((coarse, _), (fine, _)) = (end_of(&ramp(1), Watch::default()), end_of(&ramp(200), Watch::default()));
    for (a, b) in [
        (coarse.shaft_speed_rad_s, fine.shaft_speed_rad_s),
        (coarse.p2_pa, fine.p2_pa),
        (coarse.tc_k, fine.tc_k),
    ] {
        // Both are integrated to 1e-8 per step, in tens and in hundreds of steps.
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
    assert!((fine.shaft_speed_rpm() / 110e3 - 1.0).abs() < 0.02);
}

#[test]
fn a_crossing_is_reported_once_with_its_time() {
    let (_, events) = end_of(&ramp(20), Watch { overspeed_rpm: 90e3 });
    assert_eq!(events.len(), 1, "{events:?}");
    assert_eq!(events[0].crossing, Crossing::OverspeedEntered);
    assert!(
        (events[0].speed_rpm - 90e3).abs() < 1.0 && events[0].t_s > 1.0 && events[0].t_s < 20.0,
        "{events:?}"
    );
}

#[test]
fn tables_out_of_order_or_uneven_are_refused() {
    let row = BoundaryConditions::default();
    let wrong = |t_s: Vec<f64>, rows: usize| InterpolatedInputs::new(t_s, vec![row; rows]).unwrap_err();
    assert!(matches!(wrong(vec![0.0, 1.0], 1), InputsError::Lengths { times: 2, rows: 1 }));
    assert!(matches!(wrong(vec![], 0), InputsError::Lengths { .. }));
    assert!(matches!(wrong(vec![0.0, 0.0], 2), InputsError::Order { .. }));
    assert!(matches!(wrong(vec![0.0, f64::NAN], 2), InputsError::Order { .. }));
}
