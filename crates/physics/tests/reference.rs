//! Agreement with an independent implementation, every column of every reference table.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{Model, Outputs, State, rad_s_of_rpm};
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady::{self, SteadyState};
use std::collections::HashMap;

type Row = HashMap<String, f64>;

fn table(name: &str) -> Vec<Row> {
    let path = format!("{}/tests/reference/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let mut reader = csv::Reader::from_path(path).unwrap();
    let headers = reader.headers().unwrap().clone();
    reader
        .records()
        .map(|record| {
            headers
                .iter()
                .zip(record.unwrap().iter())
                .map(|(key, value)| (key.to_owned(), value.parse().unwrap()))
                .collect()
        })
        .collect()
}

/// The value that a reference column means.
fn column(name: &str, state: &State, outputs: &Outputs, boundary: &BoundaryConditions, model: &Model) -> f64 {
    match name {
        "N_rpm" => state.shaft_speed_rpm(),
        "P2_Pa" => state.p2_pa,
        "Tc_K" => state.tc_k,
        "Tt_K" => state.tt_k,
        "P3_Pa" => boundary.p3_pa,
        "x" => outputs.surge_position_ratio,
        "m_corr" => outputs.flow_corrected_kg_s,
        "m_c" => outputs.flow_kg_s,
        "m_t" => outputs.turbine_flow_kg_s,
        "eta" => outputs.efficiency,
        "h" => outputs.h_w_m2k,
        "T1p_K" => outputs.t1_prime_k,
        "T2p_K" => outputs.t2_prime_k,
        "T2_K" => outputs.t2_k,
        "T2_read_K" => outputs.t2_probe_k,
        "T4_K" => outputs.turbine.t4_k,
        "q_W" => outputs.compressor_heat_w,
        "W_c_W" => outputs.compressor_power_w,
        "alpha_A" => model.params.compressor.alpha_area_ratio,
        "d_m" => model.params.t2_probe_diameter_m,
        other => panic!("unknown reference column {other}"),
    }
}

/// Compares every column but the row's own keys; returns the worst relative difference.
fn worst(
    row: &Row,
    keys: &[&str],
    state: &State,
    outputs: &Outputs,
    boundary: &BoundaryConditions,
    model: &Model,
    tolerance: f64,
) -> f64 {
    let mut worst = 0.0f64;
    for (name, expected) in row.iter().filter(|(name, _)| !keys.contains(&name.as_str())) {
        let found = column(name, state, outputs, boundary, model);
        // A column that passes through zero (x at choke) is compared against its own scale, 1.
        let scale = if name == "x" { 1.0 } else { expected.abs().max(f64::MIN_POSITIVE) };
        let difference = (found - expected).abs() / scale;
        assert!(difference < tolerance, "{name}: {found} against {expected} ({difference:.1e}) in {row:?}");
        worst = worst.max(difference);
    }
    worst
}

fn at_opening(valve_opening_ratio: f64) -> BoundaryConditions {
    BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() }
}

#[test]
fn the_gas_path_agrees_at_every_point() {
    for row in table("points") {
        let mut model = Model::nominal();
        model.params.compressor.alpha_area_ratio = row["alpha_A"];
        let boundary = BoundaryConditions { p3_pa: 200e3, ..BoundaryConditions::default() };
        // At the surge line the flow goes with a square root whose slope is infinite: ten printed digits of P2 leave
        // five of the flow. There the line's own end is taken, which must be that P2.
        let on_surge_line = (row["x"] - 1.0).abs() < 1e-9;
        let surge_pa = boundary.p1_pa * model.map.surge_point(row["N_rpm"] * (298.0f64 / 298.15).sqrt()).1;
        assert!(!on_surge_line || (surge_pa / row["P2_Pa"] - 1.0).abs() < 1e-9);
        let p2_pa = if on_surge_line { surge_pa } else { row["P2_Pa"] };
        let state = State::new(rad_s_of_rpm(row["N_rpm"]), p2_pa, row["Tc_K"], 450.0, 300.0);
        let outputs = model.prepare(&boundary).evaluate(&state);
        // Ten digits are printed; near the ends of the line the root amplifies the last one.
        let _ =
            worst(&row, &["N_rpm", "P2_Pa", "Tc_K", "alpha_A"], &state, &outputs, &boundary, &model, 1e-6);
    }
}

#[test]
fn steady_states_agree_in_every_column() {
    let model = Model::nominal();
    for row in table("steady") {
        let found = steady::hold_speed(&model, row["speed_rpm"], &at_opening(row["valve"])).unwrap();
        let _ =
            worst(&row, &["speed_rpm", "valve"], &found.state, &found.outputs, &found.boundary, &model, 1e-6);
    }
}

/// Integrates from `start` under `boundary` and compares each row after t = 0.
fn follow(model: &Model, start: &State, boundary: &BoundaryConditions, rows: &[&Row], keys: &[&str]) {
    // Tight enough that the comparison is of models, not of tolerances: the flow amplifies P2 by up to 300.
    let mut simulator = Simulator::new(model, 0.0, *start, 1e-10, Watch::default());
    let times: Vec<f64> = rows.iter().map(|row| row["t_s"]).collect();
    let mut next = 0;
    simulator
        .run_to(
            110.0,
            boundary,
            times,
            |t_s, state, outputs| {
                if t_s > 0.0 {
                    let _ = worst(rows[next], keys, state, outputs, boundary, model, 2e-5);
                }
                next += 1;
            },
            |_| {},
        )
        .unwrap();
    assert_eq!(next, 111);
}

fn held(model: &Model, speed_rpm: f64, valve: f64) -> SteadyState {
    steady::hold_speed(model, speed_rpm, &at_opening(valve)).unwrap()
}

#[test]
fn transients_agree_in_every_column() {
    let model = Model::nominal();
    let rows = table("transients");
    for jump in rows.chunk_by(|a, b| b["t_s"] > a["t_s"]) {
        let (from, to, valve) = (jump[0]["from_rpm"], jump[0]["to_rpm"], jump[0]["valve"]);
        let rows: Vec<&Row> = jump.iter().collect();
        let start = held(&model, from, valve).state;
        follow(
            &model,
            &start,
            &held(&model, to, valve).boundary,
            &rows,
            &["from_rpm", "to_rpm", "valve", "t_s"],
        );
    }
}

#[test]
fn variants_agree_in_every_column() {
    let rows = table("variants");
    for jump in rows.chunk_by(|a, b| b["t_s"] > a["t_s"]) {
        let (from, to, valve) = (jump[0]["from_rpm"], jump[0]["to_rpm"], jump[0]["valve"]);
        let mut model = Model::nominal();
        model.params.compressor.alpha_area_ratio = jump[0]["alpha_A"];
        model.params.t2_probe_diameter_m = jump[0]["d_m"];
        // The variant's own from-state under the nominal P3 of the from-speed, and the nominal target's P3.
        let nominal = Model::nominal();
        let p3_from_pa = held(&nominal, from, valve).boundary.p3_pa;
        let start = rest_under(&model, p3_from_pa, from, valve);
        let rows: Vec<&Row> = jump.iter().collect();
        follow(
            &model,
            &start,
            &held(&nominal, to, valve).boundary,
            &rows,
            &["from_rpm", "to_rpm", "valve", "t_s", "alpha_A", "d_m"],
        );
    }
}

/// The steady state under a given P3, near `speed_rpm`: bisection over the speed that this P3 holds.
fn rest_under(model: &Model, p3_pa: f64, speed_rpm: f64, valve: f64) -> State {
    let (mut low, mut high) = (0.9 * speed_rpm, 1.1 * speed_rpm);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if held(model, middle, valve).boundary.p3_pa < p3_pa { low = middle } else { high = middle }
    }
    held(model, 0.5 * (low + high), valve).state
}
