//! Recordings with four thermocouples and two taps at each port, made on the lumped model, with and without a fault.
#![allow(dead_code, reason = "each user takes its own part")]

use mapper_core::{Channel, DeclaredUncertainty, Element, Recording, RedundantSensors, Series};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady::Inputs;
use mapper_physics::{laws::thermocouple, simulation::steady};
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;

/// The sensors of the paper's stand: channel, how many, noise, offset.
pub const STAND: [(Channel, usize, f64, f64); 8] = [
    (Channel::T1, 4, 0.1, 0.25),
    (Channel::T2, 4, 0.1, 0.25),
    (Channel::T3, 4, 0.5, 0.5),
    (Channel::T4, 4, 0.3, 0.5),
    (Channel::P1, 2, 20.0, 50.0),
    (Channel::P2, 2, 60.0, 100.0),
    (Channel::P3, 2, 80.0, 150.0),
    (Channel::P4, 2, 30.0, 50.0),
];
/// Offset shared by the sensors of a temperature, K.
pub const COMMON_K: f64 = 0.1;
/// Declared diameter of every T2 probe, m.
pub const TIP_M: f64 = 1e-3;

/// What is wrong with one of four.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Nothing.
    None,
    /// Its offset is this many declared standard deviations, in place of a draw.
    Off(f64),
    /// The same on top of its draw.
    OffBeyondItsDraw(f64),
    /// It reads one value from some moment on.
    Stuck,
    /// It reads one value and noise from some moment on.
    StuckWithNoise,
    /// Its tip has this diameter, m; at T2.
    Slow(f64),
}

/// What the model knows, at 10 Hz.
pub struct Clean {
    pub t_s: Vec<f64>,
    pub values: BTreeMap<Channel, Vec<f64>>,
    pub flow_kg_s: Vec<f64>,
}

/// Six speeds at one opening in zigzag, a minute each, from a settled start.
pub fn clean() -> Clean {
    let model = Model::nominal();
    let at = BoundaryConditions { valve_opening_ratio: 0.7, ..BoundaryConditions::default() };
    let speeds_rpm = [90e3, 150e3, 50e3, 130e3, 70e3, 110e3];
    let held = |speed_rpm: f64| steady::hold_speed(&model, speed_rpm, &at).unwrap().boundary;
    let start = steady::settle_under(&model, &held(speeds_rpm[0])).unwrap();
    let mut simulator = Simulator::new(&model, 0.0, start.state, 1e-8, Watch::default());
    let mut clean = Clean { t_s: Vec::new(), values: BTreeMap::new(), flow_kg_s: Vec::new() };
    for (step, speed_rpm) in speeds_rpm.into_iter().enumerate() {
        let boundary = held(speed_rpm);
        simulator.restart();
        let first = 600 * step as u32;
        let times = (first..first + 600).map(|i| f64::from(i) * 0.1);
        simulator
            .run_to(
                60.0 * (step + 1) as f64,
                &boundary,
                times,
                |t_s, state, outputs| {
                    clean.t_s.push(t_s);
                    clean.flow_kg_s.push(outputs.flow_kg_s);
                    let now = boundary.at(t_s);
                    for (channel, value) in [
                        (Channel::T1, now.t1_k),
                        (Channel::T2, outputs.t2_k),
                        (Channel::T3, now.t3_k),
                        (Channel::T4, outputs.turbine.t4_k),
                        (Channel::P1, now.p1_pa),
                        (Channel::P2, state.p2_pa),
                        (Channel::P3, now.p3_pa),
                        (Channel::P4, now.p4_pa),
                    ] {
                        clean.values.entry(channel).or_default().push(value);
                    }
                },
                |_| {},
            )
            .unwrap();
    }
    clean
}

/// What is declared of the stand.
pub fn declared() -> BTreeMap<Channel, RedundantSensors> {
    let of = |(channel, count, noise_sigma, offset_sigma): (Channel, usize, f64, f64)| {
        let each = DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 };
        let mut sensors = RedundantSensors::alike(channel, count, each);
        if count > 2 {
            sensors.common_offset_sigma = COMMON_K;
        }
        if channel == Channel::T2 {
            sensors.elements.iter_mut().for_each(|element| element.probe_diameter_m = TIP_M);
        }
        (channel, sensors)
    };
    STAND.map(of).into()
}

/// One recording, and which of its sensors has the fault.
pub fn record(clean: &Clean, fault: Fault, seed: u64) -> (Recording, Option<Element>) {
    let mut random = Pcg64::seed_from_u64(seed ^ 0x2545_F491_4F6C_DD1D);
    let channel = match fault {
        Fault::Slow(_) => Channel::T2,
        _ => [Channel::T1, Channel::T2, Channel::T3, Channel::T4][random.random_range(0..4)],
    };
    // A sensor that is only frozen is visible when something moves.
    let channel = if fault == Fault::StuckWithNoise { Channel::T2 } else { channel };
    let faulty = (fault != Fault::None).then(|| Element { channel, number: random.random_range(1..=4) });
    // With its noise left, one that freezes after the last jump looks as fault-free as the others.
    let last = if fault == Fault::StuckWithNoise { 0.8 } else { 0.9 };
    let stuck_from = random.random_range(clean.t_s.len() / 10..(last * clean.t_s.len() as f64) as usize);
    let mut recording = Recording::default();
    for (channel, count, noise_sigma, offset_sigma) in STAND {
        let common = if count > 2 { COMMON_K * normal(&mut random) } else { 0.0 };
        for number in 1..=count {
            let element = Element { channel, number };
            let fault = if faulty == Some(element) { fault } else { Fault::None };
            let drawn = offset_sigma * normal(&mut random);
            let offset = common
                + match fault {
                    Fault::Off(sigmas) => sigmas * offset_sigma,
                    Fault::OffBeyondItsDraw(sigmas) => drawn + sigmas * offset_sigma,
                    _ => drawn,
                };
            let mut values = match (channel, fault) {
                (Channel::T2, Fault::Slow(tip_m)) => behind_a_tip(clean, tip_m),
                (Channel::T2, _) => behind_a_tip(clean, TIP_M),
                _ => clean.values[&channel].clone(),
            };
            if fault == Fault::StuckWithNoise {
                let still = values[stuck_from];
                values[stuck_from..].fill(still);
            }
            let noise = noise(values.len(), noise_sigma, &mut random);
            values.iter_mut().zip(noise).for_each(|(value, noise)| *value += offset + noise);
            if fault == Fault::Stuck {
                let still = values[stuck_from];
                values[stuck_from..].fill(still);
            }
            recording.elements.insert(element, Series { t_s: clean.t_s.clone(), values });
        }
    }
    (recording, faulty)
}

/// The gas at the compressor's outlet as a tip of this diameter reads it: eq. 12 from sample to sample.
pub fn behind_a_tip(clean: &Clean, tip_m: f64) -> Vec<f64> {
    let gas_k = &clean.values[&Channel::T2];
    let mut tip_k = gas_k[0];
    let follow = |(gas_k, flow_kg_s): (&f64, &f64)| {
        let tau_s = thermocouple::time_constant_s(tip_m, 0.035, *flow_kg_s, *gas_k);
        tip_k = gas_k + (tip_k - gas_k) * (-0.1 / tau_s).exp();
        tip_k
    };
    gas_k.iter().zip(&clean.flow_kg_s).map(follow).collect()
}

/// Noise of a usual sensor: 0.8 white and 0.6 with a memory of 2 s, in quadrature.
pub fn noise(count: usize, sigma: f64, random: &mut impl Rng) -> Vec<f64> {
    let memory = (-0.1f64 / 2.0).exp();
    let mut slow = normal(random);
    let next = |_| {
        slow = memory * slow + (1.0 - memory * memory).sqrt() * normal(random);
        sigma * (0.8 * normal(random) + 0.6 * slow)
    };
    (0..count).map(next).collect()
}

fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Outcome of judging one recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing, or exactly the right sensor.
    Right,
    /// Another sensor, or one too many, or a contradiction.
    Wrong,
    /// Nothing where something was.
    Missed,
}

/// Judges one recording.
pub fn judged(clean: &Clean, fault: Fault, seed: u64) -> Verdict {
    let (recording, faulty) = record(clean, fault, seed);
    let channels =
        mapper_observe::judge_elements(&recording, &declared(), mapper_core::NoiseColour::default());
    let named: Vec<Element> =
        channels.iter().flat_map(|fused| &fused.left_out).map(|faulty| faulty.element).collect();
    let contradicted = channels.iter().any(|fused| fused.contradiction.is_some());
    match faulty {
        _ if named == faulty.into_iter().collect::<Vec<_>>() && !contradicted => Verdict::Right,
        Some(faulty) if !named.contains(&faulty) => Verdict::Missed,
        _ => Verdict::Wrong,
    }
}
