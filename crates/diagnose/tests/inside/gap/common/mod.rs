//! Recordings of the adaptive simulator. It shares the equations with the driven model, but not its grid, inputs or noise.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::causes::additions::Calibration;
use crate::gap::request::{ClosureSearch, GapRequest, RigRecording};
use mapper_core::{
    Channel, DeclaredUncertainty, ModelTolerances, NoiseColour, Recording, Series, StepKind, StepMarker,
};
use mapper_observe::declared::{Declared, declared_uncertainties};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{Effect, Rig};
use mapper_physics::rig::instruments::ChannelFollower;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady::{InterpolatedInputs, hold_speed};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Operating points at one opening, with a jump between consecutive points.
pub struct Visits {
    pub speeds_rpm: &'static [f64],
    pub dwell_s: f64,
}

/// Noise of a sample of each channel, and offset, one sigma.
const SENSORS: [(Channel, f64, f64); 14] = [
    (Channel::ShaftSpeed, 30.0, 0.0),
    (Channel::CompressorFlow, 1.5e-4, 0.0),
    (Channel::P1, 20.0, 50.0),
    (Channel::T1, 0.1, 0.25),
    (Channel::P2, 60.0, 100.0),
    (Channel::T2, 0.1, 0.25),
    (Channel::Tc, 0.15, 0.3),
    (Channel::TurbineFlow, 1.5e-4, 0.0),
    (Channel::P3, 80.0, 150.0),
    (Channel::T3, 0.5, 0.5),
    (Channel::P4, 30.0, 50.0),
    (Channel::T4, 0.3, 0.5),
    (Channel::Tt, 0.3, 0.5),
    (Channel::TOil, 0.2, 0.5),
];

/// The measured channels.
pub fn channels() -> Vec<Channel> {
    SENSORS.iter().map(|(channel, ..)| *channel).collect()
}

pub fn boundary() -> BoundaryConditions {
    BoundaryConditions { valve_opening_ratio: 0.9, ..BoundaryConditions::default() }
}

/// A recording of a rig with noise and offsets drawn from the declared values.
pub fn record_of(rig: &Rig, visits: &Visits, seed: u64) -> Recording {
    record_late(rig, visits, seed, &[], 0.0)
}

/// The same rig with the same offsets in another run: different noise.
pub fn record_another_night(rig: &Rig, visits: &Visits, seed: u64, night_seed: u64) -> Recording {
    recorded(rig, visits, [seed, night_seed], &[], 0.0)
}

/// A real-time run: each step is commanded late by `late_s`, s, and sample times scatter by so much, one sigma.
pub fn record_late(rig: &Rig, visits: &Visits, seed: u64, late_s: &[f64], scatter_s: f64) -> Recording {
    recorded(rig, visits, [seed, seed], late_s, scatter_s)
}

/// Offsets from the first seed, noise from the second.
fn recorded(
    rig: &Rig,
    visits: &Visits,
    [seed, night_seed]: [u64; 2],
    late_s: &[f64],
    scatter_s: f64,
) -> Recording {
    let Visits { speeds_rpm, dwell_s } = *visits;
    let nominal = Model::nominal();
    let p3_pa: Vec<f64> =
        speeds_rpm.iter().map(|n| hold_speed(&nominal, *n, &boundary()).unwrap().boundary.p3_pa).collect();
    let end_s = dwell_s * speeds_rpm.len() as f64;
    let times_s: Vec<f64> = (0..(end_s / 0.1) as usize).map(|i| 0.1 * i as f64).collect();
    let mut held_pa = p3_pa[0];
    // For a real-time run: every hundredth of a second.
    let pieces = if late_s.is_empty() { 1 } else { 10 };
    let fine_s: Vec<f64> = (0..times_s.len() * pieces).map(|i| 0.1 / pieces as f64 * i as f64).collect();
    let command_pa = |t: f64| {
        let step = (((t - 1e-6) / dwell_s).max(0.0) as usize).min(p3_pa.len() - 1);
        let begun = t - 1e-6 >= dwell_s * step as f64 + late_s.get(step).copied().unwrap_or(0.0);
        p3_pa[if begun { step } else { step.saturating_sub(1) }]
    };
    let lagged: Vec<f64> = fine_s
        .iter()
        .map(|t| {
            let wanted = command_pa(*t);
            held_pa = wanted + (held_pa - wanted) * (-0.1 / pieces as f64 / rig.instruments.p3_lag_s).exp();
            held_pa
        })
        .collect();
    // The valve came to its opening by closing.
    let valve = rig.instruments.valve;
    let valve_opening_ratio = valve.reached(boundary().valve_opening_ratio) + 0.5 * valve.play_ratio;
    let with_play = BoundaryConditions { valve_opening_ratio, ..boundary() };
    let rows = lagged.iter().map(|p3_pa| BoundaryConditions { p3_pa: *p3_pa, ..with_play }).collect();
    let inputs = InterpolatedInputs::new(fine_s, rows).unwrap();
    let at_rest = BoundaryConditions { p3_pa: p3_pa[0], ..with_play };
    let guess = hold_speed(&nominal, speeds_rpm[0], &boundary()).unwrap().state;
    let start = mapper_physics::simulation::driven::settle(&rig.model, &at_rest, guess).unwrap();
    let mut random = Pcg64::seed_from_u64(seed);
    let offsets: Vec<f64> =
        SENSORS.iter().map(|(_, _, offset)| offset * random.sample::<f64, _>(StandardNormal)).collect();
    if night_seed != seed {
        random = Pcg64::seed_from_u64(night_seed);
    }
    let mut normal = move || -> f64 { random.sample(StandardNormal) };
    let mut followers: Vec<ChannelFollower> =
        SENSORS.iter().map(|(channel, ..)| ChannelFollower::new(*rig.instruments.path(*channel))).collect();
    let mut slow = vec![0.0; SENSORS.len()];
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); SENSORS.len()];
    let decay = (-0.1f64 / 2.0).exp();
    let mut simulator = Simulator::new(&rig.model, 0.0, start, 1e-6, Watch::default());
    let sample = |t_s: f64,
                  state: &mapper_physics::simulation::model::State,
                  outputs: &mapper_physics::simulation::model::Outputs| {
        let at = mapper_physics::simulation::steady::Inputs::at(&inputs, t_s);
        let prepared = rig.model.prepare(&at);
        for (i, (channel, noise, _)) in SENSORS.iter().enumerate() {
            let seen = followers[i]
                .read(t_s, rig.instruments.at_sensor(*channel, &prepared, state, outputs).unwrap());
            slow[i] = decay * slow[i] + (1.0 - decay * decay).sqrt() * normal();
            values[i].push(seen + offsets[i] + noise * (0.8 * normal() + 0.6 * slow[i]));
        }
    };
    let mut off = Pcg64::seed_from_u64(!seed);
    let mut taken_s = |t_s: &f64| {
        let off: f64 = off.sample(StandardNormal);
        (t_s + scatter_s * off).clamp(t_s - 0.04, t_s + 0.04).max(0.0)
    };
    let taken: Vec<f64> =
        if scatter_s > 0.0 { times_s.iter().map(&mut taken_s).collect() } else { times_s.clone() };
    simulator.run_to(end_s, &inputs, taken, sample, |_| {}).unwrap();
    let commanded: Vec<f64> = times_s.iter().map(|t| command_pa(*t)).collect();
    let command = (!late_s.is_empty())
        .then(|| (Channel::P3Command, Series { t_s: times_s.clone(), values: commanded }));
    let series: BTreeMap<Channel, Series> = SENSORS
        .iter()
        .zip(values)
        .map(|((channel, ..), values)| (*channel, Series { t_s: times_s.clone(), values }))
        .chain(command)
        .collect();
    let steps = (0..speeds_rpm.len())
        .map(|index| StepMarker {
            index,
            kind: StepKind::Point,
            start_s: dwell_s * index as f64,
            end_s: dwell_s * (index + 1) as f64,
            from: None,
            to: None,
            p3_pa: p3_pa[index],
            valve_opening_ratio: boundary().valve_opening_ratio,
        })
        .collect();
    Recording { series, steps, ..Recording::default() }
}

pub fn declared() -> Declared {
    let sensors = SENSORS.iter().map(|&(channel, noise_sigma, offset_sigma)| {
        (channel, DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 })
    });
    let tolerances = ModelTolerances::default();
    Declared {
        sensors: declared_uncertainties(&sensors.collect(), &tolerances, &BTreeMap::new()),
        noise_colour: NoiseColour::default(),
        tolerances,
        nominal: boundary(),
        common_offsets: Vec::new(),
        actuators: None,
    }
}

/// A diagnosis with the library alone.
pub fn request(
    recording: &Recording,
    declared: Declared,
    model: Model,
    effects: Vec<Arc<dyn Effect>>,
) -> GapRequest<'static> {
    GapRequest {
        recording: RigRecording::simulated(recording.clone(), declared, model),
        baseline: None,
        effects,
        experiments: Vec::new(),
        closure_search: ClosureSearch::Never,
        calibration: Calibration::shipped().unwrap(),
        warnings: Vec::new(),
        progress: &|_, _| {},
    }
}

/// The library effects of these names.
pub fn effects(ids: &[&str]) -> Vec<Arc<dyn Effect>> {
    ids.iter().map(|id| mapper_effects::find(id).unwrap()).collect()
}
