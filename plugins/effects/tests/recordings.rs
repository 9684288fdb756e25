//! The effects against an independent implementation: recordings of a rig with one or two known effects, its tolerances,
//! offsets, noise and wandering boundary conditions. The model must follow only with the effect.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{self, Rig};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady;
use mapper_physics::simulation::steady::InterpolatedInputs;

/// Rows of numbers below a header line.
fn table(name: &str) -> Vec<Vec<f64>> {
    let path = format!("{}/tests/recordings/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(|value| value.parse().unwrap()).collect()).collect()
}

/// Inputs of the machine: means of 10 s between their middles, P3 behind its command with the declared 0.3 s.
fn inputs(means: &[Vec<f64>], commands: &[Vec<f64>]) -> InterpolatedInputs {
    let slow = |t_s: f64, column: usize| {
        let after = means.partition_point(|row| row[0] < t_s).clamp(1, means.len() - 1);
        let (a, b) = (&means[after - 1], &means[after]);
        a[column] + (b[column] - a[column]) * ((t_s - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0)
    };
    let held = |t_s: f64| &commands[commands.partition_point(|row| row[0] <= t_s).max(1) - 1];
    let end_s = means.last().unwrap()[0] + 5.0;
    let (mut times, mut rows) = (Vec::new(), Vec::new());
    let (mut t_s, mut p3_pa, mut before_s) = (0.0, commands[0][1], 0.0);
    while t_s <= end_s {
        // The valve and P3 change at the command; a table cannot jump, so there is a row just before.
        p3_pa = {
            let target_pa = held((t_s - 1e-6f64).max(0.0))[1];
            target_pa + (p3_pa - target_pa) * (-(t_s - before_s) / 0.3f64).exp()
        };
        times.push(t_s);
        rows.push(BoundaryConditions {
            t1_k: slow(t_s, 1),
            p1_pa: slow(t_s, 2),
            p3_pa,
            t3_k: slow(t_s, 3),
            p4_pa: slow(t_s, 4),
            oil_temperature_k: slow(t_s, 5),
            ambient_temperature_k: 298.15,
            valve_opening_ratio: held(t_s + 1e-6)[2],
        });
        before_s = t_s;
        let since_s = t_s - held(t_s + 1e-6)[0];
        let step_s = if since_s < 2.0 { 0.1 } else { 5.0 };
        let next = commands.iter().map(|row| row[0]).find(|change_s| *change_s > t_s + 1e-6);
        t_s = next.map_or(t_s + step_s, |change_s| change_s.min(t_s + step_s));
    }
    InterpolatedInputs::new(times, rows).unwrap()
}

/// Scatter of recorded minus simulated means of 10 s, after removal of its mean (an offset), of speed, P2, T2 and Tc.
fn scatter(rig: &Rig, means: &[Vec<f64>], inputs: &InterpolatedInputs) -> [f64; 4] {
    use mapper_physics::simulation::steady::Inputs;
    let start = steady::settle_under(&rig.model, &inputs.at(0.0)).unwrap();
    let mut simulator = Simulator::new(&rig.model, 0.0, start.state, 1e-6, Watch::default());
    let mut sums = vec![[0.0; 4]; means.len()];
    let samples = (0..means.len() * 20).map(|i| (i as f64 + 0.5) * 0.5);
    simulator
        .run_to(
            means.len() as f64 * 10.0,
            inputs,
            samples,
            |t_s, state, outputs| {
                let values = [state.shaft_speed_rpm(), state.p2_pa, outputs.t2_probe_k, state.tc_k];
                let row = &mut sums[(t_s / 10.0) as usize];
                row.iter_mut().zip(values).for_each(|(sum, value)| *sum += value / 20.0);
            },
            |_| {},
        )
        .unwrap();
    std::array::from_fn(|channel| {
        let residuals: Vec<f64> =
            means.iter().zip(&sums).map(|(row, sums)| row[6 + channel] - sums[channel]).collect();
        let mean = residuals.iter().sum::<f64>() / residuals.len() as f64;
        (residuals.iter().map(|residual| (residual - mean).powi(2)).sum::<f64>() / residuals.len() as f64)
            .sqrt()
    })
}

/// Three declared standard deviations of the rig: 0.5 % of efficiency (0.35 K of a rise of 70 K, and the corresponding speed
/// and pressure), 3 % of convection. The change by the effect is far larger.
const DECLARED: [f64; 4] = [400.0, 1200.0, 1.0, 1.0];

/// Name, effects with their values, most affected channel.
type Case = (&'static str, &'static [(&'static str, &'static [f64])], usize);

#[test]
fn with_its_effect_the_model_follows_the_recording_and_without_it_does_not() {
    let cases: [Case; 5] = [
        // Name, effects, most affected channel: 0 speed, 1 P2, 2 T2, 3 Tc.
        ("area_split", &[("area_split", &[0.12])], 3),
        ("tip_diameter", &[("tip_diameter", &[1.5e-3])], 2),
        ("directional_htc", &[("directional_htc", &[0.65])], 3),
        ("inner_node", &[("inner_node", &[0.35, 15.0])], 3),
        ("friction_and_valve", &[("bearing_friction", &[1.5e-6]), ("valve_area", &[1.05])], 1),
    ];
    let nominal = Rig::new(Model::nominal());
    for (name, effects, most) in cases {
        let (means, commands) = (table(name), table(&format!("{name}_commands")));
        let mut rig = nominal.clone();
        for (id, values) in effects {
            effect::add(&mut rig, mapper_effects::find(id).unwrap().as_ref(), values).unwrap();
        }
        let inputs = inputs(&means, &commands);
        let (without, with) = (scatter(&nominal, &means, &inputs), scatter(&rig, &means, &inputs));
        assert!(with[most] < without[most] / 3.0, "{name}: {without:?} without, {with:?} with its effect");
        assert!(without[most] > 1.5 * DECLARED[most], "{name}: {without:?}");
        for (found, declared) in with.iter().zip(DECLARED) {
            assert!(*found < declared, "{name}: {with:?} with its effect");
        }
    }
}
