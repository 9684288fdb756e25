//! Simulated campaigns with planted drift: a rig with tolerances, offsets, coloured noise and boundary conditions that
//! wander, visiting a reference jump before, between and after three sweeps. Not the generator of any shared recording.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{
    Channel, DeclaredUncertainty, ModelTolerances, NoiseColour, Recording, ReferenceState, RigActuators,
    Series, StepKind, StepMarker,
};
use mapper_diagnose::drift::{Cause, DriftReport, DriftRequest, RecordedRun, diagnose};
use mapper_identify::{IdentifyConfig, WindowRule};
use mapper_inference::hypotheses::TimeHistory;
use mapper_observe::declared_uncertainties;
use mapper_physics::compressor_map::closed_form_map::{
    CharacteristicPoint, ClosedFormMap, CompressorCharacteristic,
};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::rig::instruments::true_value;
use mapper_physics::simulation::driven::{FrozenGrid, drive};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::{Inputs, hold_speed};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;
use std::sync::Arc;

pub const HOLD_S: f64 = 30.0;
pub const DWELL_S: f64 = 120.0;
pub const SAMPLE_S: f64 = 0.1;

/// What drifts, how.
#[derive(Debug, Clone, Copy)]
pub struct Planted {
    pub cause: Cause,
    pub course: TimeHistory,
    /// Per hour, or step; unit of the cause.
    pub size: f64,
}

/// True efficiency at the end of each step, as a recording of the same campaign without the drift would have it.
pub struct Campaign {
    pub recording: Recording,
    /// At the machine's state of the moment.
    pub eta_true: Vec<f64>,
}

/// One-sigma noise of a sample and fixed offset after calibration.
pub const SENSORS: [(Channel, f64, f64); 14] = [
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

pub fn nominal() -> Model {
    let params = Params::default();
    Model::new(params, Arc::new(ClosedFormMap { wheel_diameter_m: params.compressor.wheel_diameter_m }))
}

/// The campaign's own word on its sensors.
pub fn identification() -> IdentifyConfig {
    let sensors = SENSORS.iter().map(|&(channel, noise_sigma, offset_sigma)| {
        (channel, DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 })
    });
    // The tolerances include the gain of both flow meters.
    let tolerances = ModelTolerances::default();
    IdentifyConfig {
        window: WindowRule::Fixed { start_s: 10.0, end_s: 110.0 },
        declared: declared_uncertainties(&sensors.collect(), &tolerances, &BTreeMap::new()),
        ..IdentifyConfig::default()
    }
}

/// The visits: a reference jump before each of three openings and at the end.
pub fn schedule() -> Vec<(f64, f64)> {
    let reference = [(70e3, 0.7), (130e3, 0.7)];
    let mut visits = Vec::new();
    // 0.55: at 0.5 every second rig of these tolerances would surge.
    for opening in [0.55, 0.7, 1.0] {
        visits.extend(reference);
        visits.extend([90e3, 150e3, 50e3, 130e3, 70e3, 110e3].map(|speed_rpm| (speed_rpm, opening)));
    }
    visits.extend(reference);
    visits
}

/// A map whose efficiency is off by a smooth 0.3 %.
#[derive(Debug)]
struct Wavy {
    inner: Arc<dyn CompressorCharacteristic>,
    phases: [f64; 2],
}

impl CompressorCharacteristic for Wavy {
    fn reference(&self) -> ReferenceState {
        self.inner.reference()
    }
    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        let mut point = self.inner.evaluate(speed_corrected_rpm, pressure_ratio);
        let wave = (speed_corrected_rpm / 25e3 + self.phases[0]).sin()
            + (3.0 * point.surge_position_ratio + self.phases[1]).sin();
        point.efficiency *= 1.0 + 0.003 * wave;
        point
    }
    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        self.inner.surge_point(speed_corrected_rpm)
    }
    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.inner.choke_flow_corrected_kg_s(speed_corrected_rpm)
    }
    fn fingerprint(&self) -> String {
        "wavy".to_owned()
    }
}

/// Slow swings of the boundary conditions, and P3 behind its commands.
struct Cell {
    levels: Vec<(f64, f64, f64)>,
    swings: [[(f64, f64, f64); 2]; 5],
}

impl Cell {
    fn swing(&self, which: usize, t_s: f64) -> f64 {
        self.swings[which]
            .iter()
            .map(|(size, period_s, phase)| size * (std::f64::consts::TAU * t_s / period_s + phase).sin())
            .sum()
    }
}

impl Inputs for Cell {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let level = self.levels.partition_point(|level| level.0 <= t_s).max(1) - 1;
        let (start_s, p3_pa, valve_opening_ratio) = self.levels[level];
        let before_pa = self.levels[level.saturating_sub(1)].1;
        let t1_k = 298.15 + self.swing(0, t_s);
        BoundaryConditions {
            t1_k,
            p1_pa: 100e3 + 200.0 * self.swing(1, t_s),
            p3_pa: p3_pa + (before_pa - p3_pa) * (-(t_s - start_s) / 0.3).exp(),
            t3_k: 773.15 + 4.0 * self.swing(2, t_s),
            p4_pa: 110e3 + 200.0 * self.swing(3, t_s),
            oil_temperature_k: 323.15 + self.swing(4, t_s),
            ambient_temperature_k: t1_k,
            valve_opening_ratio,
        }
    }
    fn next_kink_s(&self, _t_s: f64) -> f64 {
        f64::INFINITY
    }
    fn is_constant_after(&self, _t_s: f64) -> bool {
        false
    }
}

/// A whole campaign.
pub fn campaign(seed: u64, planted: Option<Planted>) -> Campaign {
    campaign_on(seed, planted, Unmodelled::default())
}

/// What the nominal machine does not have, all the time.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unmodelled {
    /// The valve stays behind its drive by half of this, on the side from which it comes.
    pub play_ratio: f64,
    /// Share of the housing's area before the wheel.
    pub alpha_area_ratio: f64,
}

/// A whole campaign on a machine that is not the nominal one.
pub fn campaign_on(seed: u64, planted: Option<Planted>, unmodelled: Unmodelled) -> Campaign {
    let Unmodelled { play_ratio, alpha_area_ratio } = unmodelled;
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let base = nominal();
    let mut truth = base.params;
    truth.compressor.flow_scale_ratio *= 1.0 + 0.005 * normal();
    truth.compressor.efficiency_scale_ratio *= 1.0 + 0.005 * normal();
    truth.turbine.peak_efficiency *= 1.0 + 0.01 * normal();
    truth.outlet.valve_area_m2 *= 1.0 + 0.005 * normal();
    truth.compressor.nusselt_coefficient *= 1.0 + 0.03 * normal();
    truth.external_convection_ratio *= 1.0 + 0.1 * normal();
    truth.bearing.oil_conductance_w_k *= 1.0 + 0.05 * normal();
    truth.compressor.alpha_area_ratio = alpha_area_ratio;
    let flow_gain = 1.0 + 0.005 * normal();
    let offsets: Vec<f64> = SENSORS.iter().map(|(_, _, offset)| offset * normal()).collect();
    let swings = std::array::from_fn(|_| {
        std::array::from_fn(|_| {
            (0.4 * normal(), 1200.0 + 1800.0 * rand_share(&mut normal), 10.0 * rand_share(&mut normal))
        })
    });
    let phases = [10.0 * rand_share(&mut normal), 10.0 * rand_share(&mut normal)];
    let map = Arc::new(Wavy { inner: base.map.clone(), phases });

    // The rig is commanded open loop: the P3 that the nominal machine needs.
    let visits = schedule();
    let mut levels: Vec<(f64, f64, f64)> = Vec::new();
    let mut position = 1.0_f64;
    let mut steps: Vec<StepMarker> = Vec::new();
    for (index, (speed_rpm, valve)) in visits.iter().enumerate() {
        let boundary = BoundaryConditions { valve_opening_ratio: *valve, ..BoundaryConditions::default() };
        let p3_pa = hold_speed(&base, *speed_rpm, &boundary).unwrap().boundary.p3_pa;
        let start_s = if index == 0 { 0.0 } else { HOLD_S + DWELL_S * index as f64 };
        position = position.clamp(valve - 0.5 * play_ratio, valve + 0.5 * play_ratio);
        levels.push((start_s, p3_pa, position));
        steps.push(StepMarker {
            index,
            kind: StepKind::Point,
            start_s,
            end_s: HOLD_S + DWELL_S * (index as f64 + 1.0),
            from: None,
            to: None,
            p3_pa,
            valve_opening_ratio: *valve,
        });
    }
    let end_s = steps.last().unwrap().end_s;
    let cell = Cell { levels, swings };

    // From step to step, the machine as it is in the middle of each.
    let first = cell.at(0.0);
    let mut state = hold_speed(&Model::new(truth, map.clone()), visits[0].0, &first).unwrap().state;
    let mut values: BTreeMap<Channel, Vec<f64>> = BTreeMap::new();
    let mut times_s = Vec::new();
    let mut eta_true = Vec::new();
    for step in &steps {
        let parts = 4;
        for part in 0..parts {
            let at = |part: f64| step.start_s + (step.end_s - step.start_s) * part / f64::from(parts);
            let (from_s, to_s) = (at(f64::from(part)), at(f64::from(part) + 1.0));
            let mut params = truth;
            if let Some(Planted { cause, course, size }) = planted {
                let now = size * course.mean(from_s, to_s);
                match cause {
                    Cause::Fouling => {
                        params.compressor.efficiency_scale_ratio *= 1.0 + now;
                        params.compressor.flow_scale_ratio *= 1.0 + 0.6 * now;
                    }
                    Cause::BearingFriction => params.bearing_friction_w_s2 += now,
                    Cause::Sensors(_) => {}
                }
            }
            let model = Model::new(params, map.clone());
            let samples: Vec<f64> = (0..)
                .map(|index| (from_s / SAMPLE_S).round() + f64::from(index) + 0.5)
                .map(|tick| tick * SAMPLE_S)
                .take_while(|t_s| *t_s < to_s)
                .collect();
            let jumps: Vec<f64> = if part == 0 { vec![from_s] } else { Vec::new() };
            // A jump lies within a grid, so that the steps after it are fine: the moment before it is gone through twice.
            let before_s = if part == 0 && step.index > 0 { 0.02 } else { 0.0 };
            let fine: Vec<f64> = (1..=800).map(|index| from_s + 0.005 * f64::from(index)).collect();
            let grid = FrozenGrid::new(from_s - before_s, to_s, &jumps, if part == 0 { &fine } else { &[] });
            let mut eta = f64::NAN;
            state = drive(&model, &cell, state, &grid, &samples, |_, prepared, state, outputs| {
                for (channel, ..) in SENSORS {
                    let value = true_value(channel, prepared, state, outputs).unwrap();
                    values.entry(channel).or_default().push(value);
                }
                eta = outputs.efficiency;
            })
            .unwrap();
            times_s.extend(samples);
            if part + 1 == parts {
                eta_true.push(eta);
            }
        }
    }
    let colour = NoiseColour::default();
    let stay = (-SAMPLE_S / colour.time_constant_s).exp();
    let mut series = BTreeMap::new();
    for ((channel, noise, _), offset) in SENSORS.iter().zip(&offsets) {
        let mut walk = normal();
        let readings = values[channel]
            .iter()
            .zip(&times_s)
            .map(|(value, t_s)| {
                walk = stay * walk + (1.0 - stay * stay).sqrt() * normal();
                let gain = if *channel == Channel::CompressorFlow { flow_gain } else { 1.0 };
                let drift = match planted {
                    Some(Planted { cause: Cause::Sensors(drifting), course, size })
                        if drifting.contains(channel) =>
                    {
                        size * course.at(*t_s)
                    }
                    _ => 0.0,
                };
                let flow = matches!(channel, Channel::CompressorFlow | Channel::TurbineFlow);
                let right = if flow { gain * value * (1.0 + drift) } else { value + offset + drift };
                right + noise * (0.8 * normal() + 0.6 * walk)
            })
            .collect();
        series.insert(*channel, Series { t_s: times_s.clone(), values: readings });
    }
    let command = |value: &dyn Fn(&StepMarker) -> f64| Series {
        t_s: steps.iter().map(|step| step.start_s).collect(),
        values: steps.iter().map(value).collect(),
    };
    series.insert(Channel::P3Command, command(&|step| step.p3_pa));
    series.insert(Channel::ValveCommand, command(&|step| step.valve_opening_ratio));
    let _ = end_s;
    Campaign { recording: Recording { series, steps, ..Recording::default() }, eta_true }
}

/// A number in 0..1 from the same stream.
fn rand_share(normal: &mut dyn FnMut() -> f64) -> f64 {
    0.5 + 0.5 * (normal() / (1.0 + normal().powi(2)).sqrt()).clamp(-1.0, 1.0)
}

/// Verdict on one recording.
pub fn judge(recording: &Recording) -> DriftReport {
    judge_all(&[RecordedRun { recording, fingerprint: None }])
}

/// The same, points identified otherwise.
pub fn judge_by(recording: &Recording, identification: &IdentifyConfig) -> DriftReport {
    ask(&[RecordedRun { recording, fingerprint: None }], identification, None)
}

/// Verdict on several recordings.
pub fn judge_all(runs: &[RecordedRun<'_>]) -> DriftReport {
    ask(runs, &identification(), None)
}

/// Verdict on one recording of a stand with these actuators.
pub fn judge_on(recording: &Recording, actuators: Option<RigActuators>) -> DriftReport {
    ask(&[RecordedRun { recording, fingerprint: None }], &identification(), actuators)
}

fn ask(
    runs: &[RecordedRun<'_>],
    identification: &IdentifyConfig,
    actuators: Option<RigActuators>,
) -> DriftReport {
    diagnose(&DriftRequest {
        runs,
        model: &nominal(),
        boundary: BoundaryConditions::default(),
        tolerances: ModelTolerances::default(),
        identification,
        actuators,
    })
    .unwrap()
}

/// A draw that decides what is planted.
pub fn draw(seed: u64) -> impl FnMut() -> f64 {
    let mut rng = Pcg64::seed_from_u64(seed);
    move || rng.random::<f64>()
}

/// Puts another sensor's drift into the readings of a campaign.
pub fn drift_reading(recording: &mut Recording, channel: Channel, course: TimeHistory, size: f64) {
    let series = recording.series.get_mut(&channel).unwrap();
    let relative = matches!(channel, Channel::CompressorFlow | Channel::TurbineFlow);
    for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
        let drift = size * course.at(*t_s);
        *value = if relative { *value * (1.0 + drift) } else { *value + drift };
    }
}
