//! The C sources, compiled as they are shipped, against the model that they were written from.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{EfficiencyDefinition, InletConvection, ReferenceState};
use mapper_fmu::{FmuMachine, FmuMap, files};
use mapper_physics::compressor_map::closed_form_map::{ClosedFormMap, CompressorCharacteristic};
use mapper_physics::compressor_map::tabulated_map::{MapRow, TabulatedMap};
use mapper_physics::gas::mixture::{Fuel, Gas};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::{Model, Outputs, State, rad_s_of_rpm};
use mapper_physics::simulation::simulate::{Simulator, Watch};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

const CLOSED_FORM: ClosedFormMap = ClosedFormMap { wheel_diameter_m: 0.052 };

/// A value of the model.
type Value = fn(&State, &Outputs) -> f64;

/// Every output of the FMU that the model has too.
const OUTPUTS: &[(&str, Value)] = &[
    ("N", |state, _| state.shaft_speed_rpm()),
    ("P2", |state, _| state.p2_pa),
    ("Tc", |state, _| state.tc_k),
    ("Tt", |state, _| state.tt_k),
    ("T_inner", |_, outputs| outputs.wall_k),
    ("T_bearing", |_, outputs| outputs.bearing_k),
    ("m_c", |_, outputs| outputs.flow_kg_s),
    ("m_corrected", |_, outputs| outputs.flow_corrected_kg_s),
    ("m_valve", |_, outputs| outputs.valve_flow_kg_s),
    ("surge_position", |_, outputs| outputs.surge_position_ratio),
    ("eta", |_, outputs| outputs.efficiency),
    ("h", |_, outputs| outputs.h_w_m2k),
    ("T1_prime", |_, outputs| outputs.t1_prime_k),
    ("T2_prime", |_, outputs| outputs.t2_prime_k),
    ("T2", |_, outputs| outputs.t2_k),
    ("T2_probe", |_, outputs| outputs.t2_probe_k),
    ("q_c", |_, outputs| outputs.compressor_heat_w),
    ("W_c", |_, outputs| outputs.compressor_power_w),
    ("m_t", |_, outputs| outputs.turbine_flow_kg_s),
    ("T4", |_, outputs| outputs.turbine.t4_k),
    ("q_t", |_, outputs| outputs.turbine.heat_w),
    ("W_t", |_, outputs| outputs.turbine.power_w),
    ("eta_t", |_, outputs| outputs.turbine.efficiency),
];

/// Value references by name, as the model description has them.
fn references(description: &str) -> BTreeMap<String, usize> {
    let attribute = |line: &str, name: &str| {
        let from = line.split_once(&format!(" {name}=\"")).unwrap().1;
        from.split_once('"').unwrap().0.to_owned()
    };
    description
        .lines()
        .filter(|line| line.contains("<Real"))
        .map(|line| (attribute(line, "name"), attribute(line, "valueReference").parse().unwrap()))
        .collect()
}

/// Compiles an FMU's sources with a small program around them; gives the rows that it prints.
fn printed(machine: &FmuMachine<'_>, seconds: usize) -> (BTreeMap<String, usize>, Vec<Vec<f64>>) {
    let folder = tempfile::tempdir().unwrap();
    let mut sources = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/print.c")];
    let mut description = String::new();
    for file in files(machine).unwrap() {
        match file.path.strip_prefix("sources/") {
            Some(name) => {
                let path = folder.path().join(name);
                std::fs::write(&path, &file.bytes).unwrap();
                if name.ends_with(".c") {
                    sources.push(path);
                }
            }
            None => description = String::from_utf8(file.bytes).unwrap(),
        }
    }
    let program = folder.path().join("print");
    // The compiler that every Rust toolchain links with; what it warns of is an error here.
    let compiled = Command::new("cc")
        .args(["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wno-unused-variable", "-I"])
        .arg(folder.path())
        .arg("-o")
        .arg(&program)
        .args(&sources)
        .arg("-lm")
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let run = Command::new(&program).arg(seconds.to_string()).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let rows = String::from_utf8(run.stdout).unwrap();
    let rows = rows.lines().map(|row| row.split_whitespace().map(|value| value.parse().unwrap()).collect());
    (references(&description), rows.collect())
}

/// The machine as FMU and as model from the same start, compared at each second.
fn agree(params: &Params, map: &FmuMap, boundary: &BoundaryConditions, start: State) {
    let characteristic: Arc<dyn CompressorCharacteristic> = match map {
        FmuMap::ClosedForm(map) => Arc::new(*map),
        FmuMap::Table(map) => Arc::new(map.clone()),
    };
    let model = Model::new(*params, characteristic);
    let mut start = start;
    start.t2_tip_k = model.prepare(boundary).evaluate(&start).t2_probe_target_k;
    let machine = FmuMachine { name: "parity", origin: "a test", params, map, boundary, start: &start };
    let (references, rows) = printed(&machine, 5);
    let mut compared = 0;
    let mut simulator = Simulator::new(&model, 0.0, start, 1e-10, Watch::default());
    let times: Vec<f64> = (0..=5).map(f64::from).collect();
    let compare = |t_s: f64, state: &State, outputs: &Outputs| {
        for (name, value) in OUTPUTS {
            let (expected, found) = (value(state, outputs), rows[compared][references[*name]]);
            // Sums of two roundings at the start; two integrations to 1e-10 per step, which the flow near surge amplifies.
            let allowed = if t_s == 0.0 { 1e-11 } else { 1e-6 };
            let scale = expected.abs().max(if name.starts_with("q_") { 100.0 } else { 1e-6 });
            assert!(
                (found - expected).abs() <= allowed * scale,
                "{name} at {t_s} s: {found} against {expected}"
            );
        }
        compared += 1;
    };
    simulator.run_to(5.0, boundary, times, compare, |_| {}).unwrap();
    assert_eq!((compared, rows.len()), (6, 6));
}

fn boundary() -> BoundaryConditions {
    BoundaryConditions {
        t1_k: 305.0,
        p1_pa: 96e3,
        p3_pa: 190e3,
        t3_k: 820.0,
        p4_pa: 108e3,
        oil_temperature_k: 350.0,
        ambient_temperature_k: 300.0,
        valve_opening_ratio: 1.1,
    }
}

fn start() -> State {
    let mut state = State::new(rad_s_of_rpm(95e3), 150e3, 340.0, 450.0, 330.0);
    state.inner_k = 350.0;
    state
}

/// Everything that a machine may have and the nominal one has not.
fn odd() -> Params {
    let mut params = Params::default();
    let compressor = &mut params.compressor;
    compressor.alpha_area_ratio = 0.25;
    compressor.inlet_convection = InletConvection::Own;
    compressor.inlet_h_ratio = 1.3;
    compressor.hot_metal_h_ratio = 0.8;
    compressor.inlet_conductance_w_k = 0.4;
    compressor.efficiency_scale_ratio = 0.97;
    compressor.flow_scale_ratio = 1.04;
    compressor.recirculation_ratio = 0.02;
    compressor.gas = Gas::air();
    compressor.humidity_kg_kg = 0.012;
    compressor.efficiency = EfficiencyDefinition::Enthalpy;
    compressor.inner_capacity_ratio = 0.3;
    params.turbine.gas = Gas::burnt(Fuel::DIESEL, 3.0);
    params.t2_probe_diameter_m = 1.5e-3;
    params.t2_probe_stem_ratio = 0.03;
    params.t2_probe_recovery_ratio = 0.9;
    params.bearing_friction_w_s2 = 5e-7;
    params.bearing.friction_heat_w = 300.0;
    params.external_convection_ratio = 1.5;
    params.radiation_area_m2 = 4e-3;
    params
}

fn table() -> FmuMap {
    let mut rows = Vec::new();
    for speed_corrected_rpm in [50e3, 80e3, 110e3, 140e3] {
        let (_, surge_pr) = CLOSED_FORM.surge_point(speed_corrected_rpm);
        for i in 0..=12 {
            let pressure_ratio = 1.0 + (surge_pr - 1.0) * (0.15 + 0.85 * f64::from(i) / 12.0);
            let point = CLOSED_FORM.evaluate(speed_corrected_rpm, pressure_ratio);
            rows.push(MapRow {
                speed_corrected_rpm,
                flow_corrected_kg_s: point.flow_corrected_kg_s * (1.0 - 1e-6 * f64::from(i)),
                pressure_ratio,
                efficiency: point.efficiency,
            });
        }
    }
    FmuMap::Table(TabulatedMap::new(&rows, ReferenceState { t_ref_k: 302.6, p_ref_pa: 96_200.0 }).unwrap())
}

#[test]
fn the_nominal_machine() {
    agree(&Params::default(), &FmuMap::ClosedForm(CLOSED_FORM), &boundary(), start());
}

#[test]
fn a_machine_with_everything() {
    agree(&odd(), &FmuMap::ClosedForm(CLOSED_FORM), &boundary(), start());
    let mut constant_gamma = odd();
    constant_gamma.compressor.efficiency = EfficiencyDefinition::ConstantGamma(1.395);
    agree(&constant_gamma, &FmuMap::ClosedForm(CLOSED_FORM), &boundary(), start());
}

#[test]
fn a_table_between_its_lines_and_with_everything() {
    agree(&Params::default(), &table(), &boundary(), start());
    agree(&odd(), &table(), &boundary(), start());
}

/// Below the slowest and above the fastest line, beyond surge and in choke.
#[test]
fn a_table_beyond_its_lines() {
    for (speed_rpm, p2_pa) in [(35e3, 103e3), (160e3, 230e3), (100e3, 240e3), (100e3, 99e3)] {
        let state = State { shaft_speed_rad_s: rad_s_of_rpm(speed_rpm), p2_pa, ..start() };
        agree(&Params::default(), &table(), &boundary(), state);
    }
}

#[test]
fn equal_machines_have_equal_files_and_others_another_guid() {
    let (map, boundary, start) = (FmuMap::ClosedForm(CLOSED_FORM), boundary(), start());
    let made = |params: &Params| {
        files(&FmuMachine { name: "a", origin: "", params, map: &map, boundary: &boundary, start: &start })
            .unwrap()
    };
    let guid = |files: &[mapper_fmu::FmuFile]| {
        let text = String::from_utf8(files[0].bytes.clone()).unwrap();
        text.split_once("guid=\"").unwrap().1[..38].to_owned()
    };
    let (nominal, again, other) = (made(&Params::default()), made(&Params::default()), made(&odd()));
    assert_eq!(mapper_fmu::archive(&nominal).unwrap(), mapper_fmu::archive(&again).unwrap());
    assert_ne!(guid(&nominal), guid(&other));
    let broken = Params { shaft_inertia_kgm2: f64::NAN, ..Params::default() };
    let refused = files(&FmuMachine {
        name: "a",
        origin: "",
        params: &broken,
        map: &map,
        boundary: &boundary,
        start: &start,
    });
    assert!(refused.unwrap_err().to_string().contains("shaft.inertia"));
}
