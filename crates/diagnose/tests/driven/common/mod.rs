//! Simulated engines with known truth: the lumped machine accelerates and brakes, and sensors measure it.

#![allow(dead_code, reason = "each test binary needs some of it")]

use mapper_core::{Channel, Recording, Series};
use mapper_effects::catalogue;
use mapper_observe::Declared;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::rig::instruments::{ChannelFollower, true_value};
use mapper_physics::rig::sensor_fault::log_effects;
use mapper_physics::simulation::driven::{FrozenGrid, drive};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::{InterpolatedInputs, hold_speed};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Start of full load, and of the exhaust brake: less pressure upstream of the turbine, less air.
pub const LOAD_S: f64 = 6.4;
pub const BRAKE_S: f64 = 13.2;
const END_S: f64 = 18.0;

/// Recorded channels of each engine, with their noise in the channel's unit.
const CHANNELS: [(Channel, f64); 13] = [
    (Channel::ShaftSpeed, 50.0),
    (Channel::CompressorFlow, 2e-4),
    (Channel::P1, 50.0),
    (Channel::P2, 100.0),
    (Channel::T1, 0.1),
    (Channel::T2, 0.1),
    (Channel::Tc, 0.1),
    (Channel::TurbineFlow, 2e-4),
    (Channel::P3, 100.0),
    (Channel::T3, 0.3),
    (Channel::P4, 50.0),
    (Channel::T4, 0.3),
    (Channel::Tt, 0.5),
];

/// Time history of an engine: times of the corners, and speed and valve at each.
pub struct Course {
    pub corners_s: Vec<f64>,
    pub places: Vec<(f64, f64)>,
}

impl Course {
    /// Idle, full load, exhaust brake, in eighteen seconds.
    pub fn brake() -> Self {
        Course {
            corners_s: vec![0.0, LOAD_S, LOAD_S + 2.0, BRAKE_S, BRAKE_S + 0.5, END_S],
            places: vec![(50e3, 0.8), (50e3, 0.8), (140e3, 0.9), (140e3, 0.9), (90e3, 0.7), (90e3, 0.7)],
        }
    }

    /// Four minutes of hills, long enough to show metal temperatures.
    pub fn hills() -> Self {
        let speeds = [60e3, 130e3, 80e3, 145e3, 100e3, 60e3, 120e3, 90e3];
        let mut course = Course { corners_s: Vec::new(), places: Vec::new() };
        for (i, speed_rpm) in speeds.into_iter().enumerate() {
            let valve = [0.8, 0.9, 0.7, 1.0][i % 4];
            course.corners_s.extend([30.0 * i as f64, 30.0 * i as f64 + 27.0]);
            course.places.extend([(speed_rpm, valve); 2]);
        }
        course
    }
}

/// Lag of the T2 element within the probe's tip, s, as a plantable fault: a sheathed probe has it, a bare one does not.
pub const ELEMENT_LAG: &str = "element lag";

/// Planted inner wall, as a share of the housing's heat capacity; the reported parameter is its conductance, W/K.
const INNER_WALL_RATIO: f64 = 0.4;

/// A log of a machine with its own efficiency, heat transfer and housing, and `planted` effects; also returns its truth.
pub fn engine(
    seed: u64,
    course: &Course,
    planted: &[(&str, f64)],
    own: impl Fn(&mut Params, &mut dyn FnMut(f64) -> f64),
) -> (Recording, Params) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = |width: f64| -> f64 {
        let z: f64 = StandardNormal.sample(&mut random);
        width * z
    };
    let mut rig = Rig::new(Model::nominal());
    own(&mut rig.model.params, &mut normal);
    for (id, value) in planted {
        if *id == ELEMENT_LAG {
            rig.instruments.path_mut(Channel::T2).lag_s += value;
            continue;
        }
        let effects = [catalogue(), log_effects(false)].concat();
        let effect = effects.iter().find(|effect| effect.info().id == *id).unwrap();
        let wall = [INNER_WALL_RATIO, *value];
        let values = if *id == "inner_node" { &wall[..] } else { &wall[1..] };
        add(&mut rig, effect.as_ref(), values).unwrap();
    }
    let (flow_gain, t2_offset_k) = (1.0 + normal(0.01), normal(0.5));
    let model = &rig.model;
    let at = |(speed_rpm, valve_opening_ratio): (f64, f64)| {
        let boundary = BoundaryConditions {
            valve_opening_ratio,
            t3_k: 550.0 + 2e-3 * speed_rpm,
            ..BoundaryConditions::default()
        };
        hold_speed(model, speed_rpm, &boundary).unwrap()
    };
    let held: Vec<_> = course.places.iter().map(|place| at(*place)).collect();
    let engine =
        InterpolatedInputs::new(course.corners_s.clone(), held.iter().map(|state| state.boundary).collect())
            .unwrap();
    let end_s = *course.corners_s.last().unwrap();
    let times_s: Vec<f64> = (1..=(10.0 * end_s) as usize).map(|i| 0.1 * i as f64).collect();
    let grid = FrozenGrid::new(0.0, end_s, &course.corners_s, &times_s);
    let mut columns = vec![Vec::new(); CHANNELS.len()];
    let mut followers = CHANNELS.map(|(channel, _)| ChannelFollower::new(*rig.instruments.path(channel)));
    let mut noise = Pcg64Mcg::seed_from_u64(seed + 1000);
    drive(model, &engine, held[0].state, &grid, &times_s, |i, prepared, state, outputs| {
        for ((channel, sigma), (column, follower)) in
            CHANNELS.iter().zip(columns.iter_mut().zip(&mut followers))
        {
            let z: f64 = StandardNormal.sample(&mut noise);
            let seen = true_value(*channel, prepared, state, outputs).unwrap();
            let read = follower.read(times_s[i], seen);
            column.push(
                match channel {
                    Channel::CompressorFlow => flow_gain * read,
                    Channel::T2 => t2_offset_k + read,
                    _ => read,
                } + sigma * z,
            );
        }
    })
    .unwrap();
    let series = CHANNELS.into_iter().zip(columns);
    let series =
        series.map(|((channel, _), values)| (channel, Series { t_s: times_s.clone(), values })).collect();
    (Recording { series, ..Recording::default() }, rig.model.params)
}

/// Deviations of a fault-free machine: efficiency, heat transfer, housing.
pub fn healthy(params: &mut Params, normal: &mut dyn FnMut(f64) -> f64) {
    params.compressor.efficiency_scale_ratio = 1.0 + normal(0.04);
    params.compressor.nusselt_coefficient *= normal(0.3).exp();
    params.compressor.housing_mass_kg *= normal(0.3).exp();
    params.turbine.peak_efficiency *= 1.0 + normal(0.05);
    params.turbine.peak_blade_speed_ratio *= 1.0 + normal(0.03);
    params.turbine.nusselt_coefficient *= normal(0.3).exp();
    params.turbine.housing_mass_kg *= normal(0.3).exp();
}

/// Noise of the engines' sensors.
pub fn declared() -> Declared {
    Declared {
        sensors: CHANNELS
            .iter()
            .map(|(channel, noise_sigma)| {
                (
                    *channel,
                    mapper_core::DeclaredUncertainty { noise_sigma: *noise_sigma, ..Default::default() },
                )
            })
            .collect(),
        noise_colour: Default::default(),
        tolerances: Default::default(),
        nominal: BoundaryConditions::default(),
        common_offsets: Vec::new(),
        actuators: None,
    }
}
