//! Effects written in rhai: the same physics as built-in ones, and a closed sandbox.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::Channel;
use mapper_effects::ScriptEffect;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{self, Effect, Rig};
use mapper_physics::rig::instruments::true_value;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady;
use std::path::Path;

fn script(text: &str) -> Result<ScriptEffect, String> {
    ScriptEffect::new(text, Path::new("suspect.rhai")).map_err(|error| error.to_string())
}

fn with_body(body: &str) -> Result<ScriptEffect, String> {
    script(&format!(
        "//! effect: suspect\n//! submodel: shaft\n//! parameter: c [1] -1 .. 1, neutral 0, step 0.1\n{body}"
    ))
}

fn with(effect: &dyn Effect, value: f64) -> Rig {
    let mut rig = Rig::new(Model::nominal());
    effect::add(&mut rig, effect, &[value]).unwrap();
    rig
}

/// 110 -> 70 krpm, speed and housing temperature each second for 30 s.
fn course(rig: &Rig) -> Vec<f64> {
    let hold = |speed_rpm: f64| {
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..Default::default() };
        steady::hold_speed(&Model::nominal(), speed_rpm, &boundary).unwrap()
    };
    let start = steady::hold_speed(&rig.model, 110e3, &hold(110e3).boundary).unwrap().state;
    let mut simulator = Simulator::new(&rig.model, 0.0, start, 1e-9, Watch::default());
    let mut course = Vec::new();
    let times = (0..=30).map(f64::from);
    simulator
        .run_to(
            30.0,
            &hold(70e3).boundary,
            times,
            |_, state, _| course.extend([state.shaft_speed_rpm(), state.tc_k]),
            |_| {},
        )
        .unwrap();
    course
}

#[test]
fn the_example_is_the_built_in_friction() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/effects/bearing_friction.rhai");
    let scripted = ScriptEffect::new(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    let built_in = mapper_effects::find("bearing_friction").unwrap();
    let (scripted, built_in) = (course(&with(&scripted, 1.5e-6)), course(&with(built_in.as_ref(), 1.5e-6)));
    for (a, b) in scripted.iter().zip(&built_in) {
        // Both are integrated to 1e-9 per step, in some tens of steps.
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn every_example_reads_and_at_neutral_changes_nothing() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/effects");
    let nominal = course(&Rig::new(Model::nominal()));
    let mut count = 0;
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let effect = ScriptEffect::new(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
        let neutral = effect.info().parameters[0].neutral;
        assert_eq!(course(&with(&effect, neutral)), nominal);
        let step = effect.info().parameters[0].typical_step;
        assert_ne!(course(&with(&effect, neutral + step)), nominal);
        count += 1;
    }
    assert!(count >= 2);
}

/// A steady state with a conductance to water: the heat from the water follows the energy balance.
#[test]
fn heat_of_a_script_is_balanced_at_rest() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/effects/coolant_passage.rhai");
    let effect = ScriptEffect::new(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    let rig = with(&effect, 2.0);
    let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..Default::default() };
    let rest = steady::hold_speed(&rig.model, 90e3, &boundary).unwrap();
    let water_w = 2.0 * (358.15 - rest.state.tc_k);
    let prepared = rig.model.prepare(&rest.boundary);
    assert!((rest.outputs.added.compressor_heat_w - water_w).abs() < 1e-9 && water_w > 1.0);
    assert!(prepared.compressor_housing_balance_w(&rest.state, &rest.outputs).abs() < 1e-6);
}

#[test]
fn a_script_changes_the_reading_it_names_and_no_other() {
    let effect = with_body("fn reading_T2(at, p, value) { value + p.c * (at.tc_k - value) }").unwrap();
    let rig = with(&effect, 0.1);
    let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..Default::default() };
    let rest = steady::hold_speed(&rig.model, 90e3, &boundary).unwrap();
    let prepared = rig.model.prepare(&rest.boundary);
    let read = |channel| true_value(channel, &prepared, &rest.state, &rest.outputs).unwrap();
    let expected = 0.9 * rest.outputs.t2_k + 0.1 * rest.state.tc_k;
    assert!((read(Channel::T2) - expected).abs() < 1e-9);
    assert_eq!(read(Channel::Tc), rest.state.tc_k);
}

#[test]
fn mistakes_are_named_with_their_line() {
    for (result, expected) in [
        (script("fn flow_kg_s(at, p, v) { v }"), "has no `//! parameter"),
        (script("//! effect: Bad Name\n"), "suspect.rhai:1: `Bad Name` is not a valid name"),
        (script("//! effect: a\n//! submodel: engine\n"), "suspect.rhai:2: `engine` is not a submodel"),
        (script("//! effect: a\n//! parameter: c 0 .. 1\n"), "suspect.rhai:2: write `//! parameter"),
        (script("//! parameter: c [1] 0 .. 1, neutral 2, step 0.1\n"), "contain the neutral value 2"),
        (script("//! colour: red\n"), "`colour` is not a key"),
        (with_body(""), "it defines no hook"),
        (with_body("fn flow_kg_s(at) { 1.0 }"), "write flow_kg_s(at, p, value)"),
        (with_body("fn reading_T9(at, p, value) { value }"), "no channel is called `T9`"),
        (with_body("fn flow_kg_s(at, p, value) { value +"), "suspect.rhai:4"),
        (with_body("fn flow_kg_s(at, p, value) { nothing }"), "nothing"),
        (with_body("fn flow_kg_s(at, p, value) { let a = [1]; value }"), "["),
        (with_body("fn flow_kg_s(at, p, value) { let a = #{b: 1}; value }"), "#{"),
        (with_body("fn flow_kg_s(at, p, value) { eval(\"1\") }"), "eval"),
        (with_body(&format!("// {}", "x".repeat(70_000))), "are more than 65536"),
    ] {
        let message = result.err().unwrap_or_else(|| panic!("{expected}: no mistake was found"));
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

/// An error at run time gives NaN, which stops the simulation, and is stored.
#[test]
fn a_script_that_fails_or_never_ends_stops_the_simulation_and_says_why() {
    for (body, expected) in [
        ("fn shaft_torque_nm(at, p) { loop { } }", "operations"),
        ("fn shaft_torque_nm(at, p) { shaft_torque_nm(at, p) }", "overflow"),
        ("fn shaft_torque_nm(at, p) { \"much\" }", "must give a number"),
        ("fn shaft_torque_nm(at, p) { at.weather }", "weather"),
        ("fn shaft_torque_nm(at, p) { throw \"no\" }", "no"),
    ] {
        let rig = with(&with_body(body).unwrap(), 0.5);
        let boundary = BoundaryConditions { p3_pa: 165e3, ..Default::default() };
        assert!(steady::hold_speed(&rig.model, 90e3, &boundary).is_err(), "{body}");
        let fault = rig.model.hooks.fault().expect(body);
        assert!(fault.to_lowercase().contains(expected), "{body}: {fault}");
    }
}
