//! Measures how much slower a scripted effect is than the same built-in effect:
//! `cargo run --release --locked -p mapper-effects --example script_speed`
#![allow(clippy::print_stdout)]

use mapper_effects::ScriptEffect;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{self, Effect, Rig};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{DEFAULT_RELATIVE_TOLERANCE, Simulator, Watch};
use mapper_physics::simulation::steady;
use std::path::Path;
use std::time::Instant;

const TRANSIENTS: u32 = 100;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new("examples/effects/bearing_friction.rhai");
    let scripted = ScriptEffect::new(&std::fs::read_to_string(path)?, path)?;
    let built_in = mapper_effects::find("bearing_friction").ok_or("no such effect")?;
    let hold = |speed_rpm: f64| {
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..Default::default() };
        steady::hold_speed(&Model::nominal(), speed_rpm, &boundary)
    };
    let (from, to) = (hold(110e3)?, hold(50e3)?);
    let effects: [(&str, &dyn Effect); 2] = [("built in", built_in.as_ref()), ("script", &scripted)];
    for (name, effect) in effects {
        let mut rig = Rig::new(Model::nominal());
        effect::add(&mut rig, effect, &[1.5e-6])?;
        let started = Instant::now();
        for _ in 0..TRANSIENTS {
            let mut simulator =
                Simulator::new(&rig.model, 0.0, from.state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
            let times = (1..=1100).map(|i| f64::from(i) * 0.1);
            simulator.run_to(110.0, &to.boundary, times, |_, _, _| {}, |_| {})?;
        }
        let each_ms = started.elapsed().as_secs_f64() * 1e3 / f64::from(TRANSIENTS);
        println!("{name}: {each_ms:.2} ms per transient of 110 s with outputs at 10 Hz");
    }
    Ok(())
}
