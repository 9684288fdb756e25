//! Continuous campaigns on the lumped model, with their true values: noise-free, or as a rig would record them.
#![allow(dead_code, reason = "each user takes its own part")]

use super::common::add_noise;
use mapper_core::{Channel, InletConvection, OperatingPoint, Recording, StepKind, StepMarker};
use mapper_identify::DeclaredUncertainty;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::{CompressionInputs, compress, isentropic_rise_ratio};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;

/// True values at the end of a step.
#[derive(Debug, Clone, Copy)]
pub struct Truth {
    pub eta: f64,
    pub h_w_m2k: f64,
    pub speed_rpm: f64,
}

pub struct Campaign {
    pub recording: Recording,
    pub truth: Vec<Truth>,
}

/// Differences from the nominal machine.
#[derive(Debug, Clone, Copy)]
pub struct Machine {
    pub alpha: f64,
    pub probe_m: f64,
    /// Factor on h if the metal is hotter than the gas.
    pub direction: f64,
    /// The law of h before the wheel.
    pub inlet: InletConvection,
    /// Water per dry air, kg/kg.
    pub humidity_kg_kg: f64,
    /// Efficiency, flow, convection and valve area over those of the nominal machine.
    pub scales: [f64; 4],
}

impl Default for Machine {
    fn default() -> Self {
        Machine {
            alpha: 0.0,
            probe_m: 0.0,
            direction: 1.0,
            inlet: InletConvection::Shared,
            humidity_kg_kg: 0.0,
            scales: [1.0; 4],
        }
    }
}

impl Machine {
    fn model(&self) -> Model {
        let mut model = Model::nominal();
        model.params.compressor.alpha_area_ratio = self.alpha;
        model.params.compressor.inlet_convection = self.inlet;
        model.params.compressor.humidity_kg_kg = self.humidity_kg_kg;
        model.params.t2_probe_diameter_m = self.probe_m;
        let [efficiency, flow, convection, valve] = self.scales;
        model.params.compressor.efficiency_scale_ratio = efficiency;
        model.params.compressor.flow_scale_ratio = flow;
        model.params.compressor.nusselt_coefficient *= convection;
        model.params.outlet.valve_area_m2 *= valve;
        model
    }
}

/// Visits the points in the given order, `dwell_s` each, from the settled first one; 10 Hz, no noise. The turbine inlet pressure is the one
/// that holds the speed on the nominal machine.
pub fn campaign(points: &[(f64, f64)], dwell_s: f64, machine: Machine) -> Campaign {
    let (model, nominal) = (machine.model(), Model::nominal());
    let at = |valve: f64| BoundaryConditions { valve_opening_ratio: valve, ..BoundaryConditions::default() };
    let held = |(valve, speed): (f64, f64)| steady::hold_speed(&nominal, speed, &at(valve)).unwrap().boundary;
    let first = held(points[0]);
    let start = steady::settle_under(&model, &first).unwrap();
    let mut simulator = Simulator::new(&model, 0.0, start.state, 1e-8, Watch::default());
    let mut recording = Recording::default();
    let mut truth = Vec::new();
    let count = (dwell_s * 10.0).round() as u32;
    for (index, point) in points.iter().enumerate() {
        let start_s = index as f64 * dwell_s;
        let boundary = held(*point);
        simulator.restart();
        let from = index as u32 * count;
        let times = (from..from + count).map(|i| f64::from(i) * 0.1);
        let mut last = Truth { eta: 0.0, h_w_m2k: 0.0, speed_rpm: 0.0 };
        simulator
            .run_to(
                start_s + dwell_s,
                &boundary,
                times,
                |t_s, state, outputs| {
                    last = Truth {
                        eta: outputs.efficiency,
                        h_w_m2k: outputs.h_w_m2k,
                        speed_rpm: state.shaft_speed_rpm(),
                    };
                    let t2_k = if machine.direction == 1.0 {
                        outputs.t2_probe_k
                    } else {
                        directional(machine, &boundary, state.tc_k, outputs)
                    };
                    for (channel, value) in [
                        (Channel::ShaftSpeed, state.shaft_speed_rpm()),
                        (Channel::CompressorFlow, outputs.flow_kg_s),
                        (Channel::P1, boundary.p1_pa),
                        (Channel::T1, boundary.t1_k),
                        (Channel::P2, state.p2_pa),
                        (Channel::T2, t2_k),
                        (Channel::Tc, state.tc_k),
                        (Channel::TurbineFlow, outputs.turbine_flow_kg_s),
                        (Channel::P3, boundary.p3_pa),
                        (Channel::T3, boundary.t3_k),
                        (Channel::T4, outputs.turbine.t4_k),
                    ] {
                        let series = recording.series.entry(channel).or_default();
                        series.t_s.push(t_s);
                        series.values.push(value);
                    }
                },
                |_| {},
            )
            .unwrap();
        let op = |(valve, speed): (f64, f64)| OperatingPoint { speed_rpm: speed, valve_opening_ratio: valve };
        recording.steps.push(StepMarker {
            index,
            kind: StepKind::Point,
            start_s,
            end_s: start_s + dwell_s,
            from: index.checked_sub(1).map(|before| op(points[before])),
            to: Some(op(*point)),
            p3_pa: boundary.p3_pa,
            valve_opening_ratio: point.0,
        });
        truth.push(last);
    }
    Campaign { recording, truth }
}

/// T2 with a factor on h if the metal is hotter: the gas path of the model, evaluated once more.
fn directional(
    machine: Machine,
    boundary: &BoundaryConditions,
    tc_k: f64,
    outputs: &mapper_physics::simulation::model::Outputs,
) -> f64 {
    let rise = isentropic_rise_ratio(outputs.pressure_ratio, boundary.t1_k, Air::PAPER);
    let bulk_k = boundary.t1_k * (1.0 + rise / outputs.efficiency);
    let area_m2 = 29e-3;
    let factor = |hotter: bool| if hotter { machine.direction } else { 1.0 };
    let before_m2 = machine.alpha * area_m2 * factor(tc_k > boundary.t1_k);
    let pass = |after_m2: f64| {
        let inputs = CompressionInputs {
            air: Air::PAPER,
            t1_k: boundary.t1_k,
            tc_k,
            flow_kg_s: outputs.flow_kg_s,
            isentropic_rise_ratio: rise,
            efficiency: outputs.efficiency,
            h_w_m2k: outputs.h_w_m2k,
            // Test machines have either a heating/cooling ratio or their own inlet law.
            inlet_h_ratio: 1.0,
            alpha_area_ratio: before_m2 / (before_m2 + after_m2),
            internal_area_m2: before_m2 + after_m2,
        };
        compress(&inputs, Some(bulk_k))
    };
    let after_m2 = (1.0 - machine.alpha) * area_m2;
    let t2_prime_k = pass(after_m2).t2_prime_k;
    pass(after_m2 * factor(tc_k > t2_prime_k)).t2_k
}

/// The grid of a rig's recordings: three openings, at each six speeds in zigzag.
pub fn eighteen() -> Vec<(f64, f64)> {
    let speeds = [90e3, 150e3, 50e3, 130e3, 70e3, 110e3];
    [0.5, 0.7, 1.0].into_iter().flat_map(|valve| speeds.map(|speed| (valve, speed))).collect()
}

/// Noise and offsets for all channels, scaled; offsets drawn from their declaration.
pub fn measured(
    clean: &Recording,
    noise_scale: f64,
    offset_scale: f64,
    rng: &mut impl Rng,
) -> (Recording, BTreeMap<Channel, DeclaredUncertainty>) {
    let mut recording = clean.clone();
    let mut declared = BTreeMap::new();
    for (channel, noise, offset) in super::common::RIG {
        let (noise_sigma, offset_sigma) = (noise * noise_scale, offset * offset_scale);
        declared.insert(channel, DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 });
        let series = recording.series.get_mut(&channel).unwrap();
        add_noise(series, noise_sigma, rng);
        let shift: f64 = StandardNormal.sample(rng);
        series.values.iter_mut().for_each(|value| *value += shift * offset_sigma);
    }
    (recording, declared)
}
