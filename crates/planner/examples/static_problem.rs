//! The ordering problem without memory, for comparison with other solvers: writes the weights of all jumps as JSON, with the order found
//! by this program's search and its time.
//!
//! `static_problem POINTS [SEED]`. The weight of a jump is the change of the compressor housing temperature from 10 to 110 s, in K. The
//! housing starts from its steady state and has one time constant at each point, `C/(h A/(1 + NTU) + G_bearing)`.

#![allow(clippy::print_stdout, reason = "what it prints is what it is for")]

use mapper_physics::gas::air;
use mapper_physics::laws::housing;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady;
use mapper_planner::housing::{Chain, gradients_k};
use mapper_planner::{Effort, search};
use std::time::Instant;

/// Weights row after row, and the number of rows.
struct Fixed(Vec<f64>, usize);

impl Chain for Fixed {
    type State = ();

    fn len(&self) -> usize {
        self.1
    }

    fn first(&self, _to: usize) {}

    fn step(&self, from: usize, to: usize, (): ()) -> (f64, ()) {
        (self.0[from * self.1 + to], ())
    }

    fn settled(&self, _at: usize) {}

    fn is_indistinguishable(&self, (): (), (): ()) -> bool {
        true
    }
}

/// Settled housing temperature, K, and time constant, s, at points spread over the map.
fn points(count: usize) -> Result<Vec<(f64, f64)>, Box<dyn std::error::Error>> {
    let model = Model::nominal();
    let params = &model.params;
    (0..count)
        .map(|i| {
            // A Kronecker sequence spreads any number of points evenly; its steps are those of the plastic number.
            let along = |step: f64| (0.5 + step * i as f64).fract();
            let speed_rpm = 50e3 + 100e3 * along(0.754_877_666_246_692_8);
            let boundary = BoundaryConditions {
                valve_opening_ratio: 0.5 + 2.0 * along(0.569_840_290_998_053_2),
                ..BoundaryConditions::default()
            };
            let steady = steady::hold_speed(&model, speed_rpm, &boundary)?;
            let (outputs, tc_k) = (&steady.outputs, steady.state.tc_k);
            let gas_w_k = outputs.h_w_m2k * params.compressor.internal_area_m2;
            let cp = air::heat_capacity_j_kgk(outputs.t2_prime_k);
            let conductance_w_k = gas_w_k / (1.0 + gas_w_k / (outputs.flow_kg_s * cp))
                + housing::bearing_conductance_w_k(&params.bearing);
            Ok((tc_k, housing::compressor_capacity_j_k(params, tc_k) / conductance_w_k))
        })
        .collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let count: usize = arguments.next().map_or(Ok(50), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let points = points(count)?;
    let weight = |(from_k, _): (f64, f64), (to_k, tau_s): (f64, f64)| {
        (from_k - to_k).abs() * ((-10.0 / tau_s).exp() - (-110.0 / tau_s).exp())
    };
    let weights: Vec<f64> =
        points.iter().flat_map(|from| points.iter().map(|to| weight(*from, *to))).collect();
    let chain = Fixed(weights, count);
    let given: Vec<usize> = (0..count).collect();
    let started = Instant::now();
    let order = search(&chain, &given, Effort::usual(count, 1.0), seed).swap_remove(0);
    let seconds = started.elapsed().as_secs_f64();
    let sum_k: f64 = gradients_k(&chain, &order).iter().sum();
    let rows: Vec<&[f64]> = chain.0.chunks(count).collect();
    println!(
        "{}",
        serde_json::json!({"points": count, "sum_k": sum_k, "seconds": seconds, "order": order, "weight_k": rows})
    );
    Ok(())
}
