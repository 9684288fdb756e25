//! Integrates the 12 reference jumps, 110 s each, with all outputs at 10 Hz, and prints the time per transient.
//!
//! `cargo run --release --locked -p mapper-physics --example transients -- REPEATS [RTOL]`, for comparison with a peer.
#![allow(clippy::print_stdout)]

use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{DEFAULT_RELATIVE_TOLERANCE, Simulator, Watch};
use mapper_physics::simulation::steady::{self, SteadyError, SteadyState};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let repeats: usize = arguments.next().map_or(Ok(50), |text| text.parse())?;
    let relative_tolerance: f64 =
        arguments.next().map_or(Ok(DEFAULT_RELATIVE_TOLERANCE), |text| text.parse())?;
    let model = Model::nominal();
    let hold = |speed_rpm: f64, valve_opening_ratio: f64| -> Result<SteadyState, SteadyError> {
        let boundary = BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
        steady::hold_speed(&model, speed_rpm, &boundary)
    };
    let mut jumps: Vec<(SteadyState, SteadyState)> = Vec::new();
    for (from, to) in [(110e3, 50e3), (50e3, 110e3), (150e3, 90e3), (90e3, 150e3)] {
        for valve in [0.5, 0.7, 1.0] {
            jumps.push((hold(from, valve)?, hold(to, valve)?));
        }
    }
    let start = Instant::now();
    let (mut steps, mut outputs_made, mut t2_sum_k) = (0, 0, 0.0);
    for _ in 0..repeats {
        for (from, to) in &jumps {
            let mut simulator = Simulator::new(&model, 0.0, from.state, relative_tolerance, Watch::default());
            let times = (1..=1100).map(|i| f64::from(i) * 0.1);
            simulator.run_to(
                110.0,
                &to.boundary,
                times,
                |_, _, outputs| {
                    outputs_made += 1;
                    t2_sum_k += outputs.t2_k;
                },
                |_| {},
            )?;
            steps += simulator.steps();
        }
    }
    let transients = repeats * jumps.len();
    println!(
        "{:.4} ms per transient (rtol {relative_tolerance:e}, {} steps, {} outputs, mean T2 {:.6} K)",
        start.elapsed().as_secs_f64() * 1e3 / transients as f64,
        steps / transients,
        outputs_made / transients,
        t2_sum_k / outputs_made as f64,
    );
    Ok(())
}
