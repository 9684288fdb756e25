//! Continuous campaigns on the lumped model, with their true values: noise-free, or as a rig would record them.
#![allow(dead_code, reason = "each user takes its own part")]

use super::common::add_noise;
use mapper_core::{
    Channel, InletConvection, OperatingPoint, Recording, ReferenceState, StepKind, StepMarker,
};
use mapper_identify::DeclaredUncertainty;
use mapper_physics::compressor_map::closed_form_map::{
    CharacteristicPoint, ClosedFormMap, CompressorCharacteristic,
};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::{CompressionInputs, compress, isentropic_rise_ratio};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;
use std::sync::Arc;

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
    pub heating_cooling_ratio: f64,
    /// The law of h before the wheel.
    pub inlet: InletConvection,
    /// Water per dry air, kg/kg.
    pub humidity_kg_kg: f64,
    /// Efficiency, flow, convection and valve area over those of the nominal machine.
    pub scales: [f64; 4],
    /// Diameter of the wheel over that of the nominal machine; all lengths are in proportion.
    pub size: f64,
    /// Efficiency lost at low speed, fraction: multiplies the square of middle over corrected speed, minus 1.
    pub low_speed_loss: f64,
    /// Efficiency lost at choke, fraction.
    pub choke_loss: f64,
    /// Pressure and temperature at the inlet, Pa and K.
    pub inlet_air: (f64, f64),
}

/// A map with further losses of efficiency.
#[derive(Debug)]
struct Lossy {
    map: ClosedFormMap,
    machine: Machine,
}

impl CompressorCharacteristic for Lossy {
    fn reference(&self) -> ReferenceState {
        self.map.reference()
    }

    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        self.evaluate_scaled(speed_corrected_rpm, pressure_ratio, 1.0)
    }

    fn evaluate_scaled(
        &self,
        speed_corrected_rpm: f64,
        pressure_ratio: f64,
        flow: f64,
    ) -> CharacteristicPoint {
        let point = self.map.evaluate_scaled(speed_corrected_rpm, pressure_ratio, flow);
        // Slower lines are passed only while a state is sought.
        let slowness = (100e3 / (self.machine.size * speed_corrected_rpm)).powi(2).min(5.0) - 1.0;
        let choke = (1.0 - point.surge_position_ratio).max(0.0).powi(3);
        let lost = self.machine.low_speed_loss * slowness + self.machine.choke_loss * choke;
        CharacteristicPoint { efficiency: point.efficiency - lost, ..point }
    }

    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        self.map.surge_point(speed_corrected_rpm)
    }

    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.map.choke_flow_corrected_kg_s(speed_corrected_rpm)
    }

    fn fingerprint(&self) -> String {
        format!("{self:?}")
    }
}

impl Default for Machine {
    fn default() -> Self {
        Machine {
            alpha: 0.0,
            probe_m: 0.0,
            heating_cooling_ratio: 1.0,
            inlet: InletConvection::Shared,
            humidity_kg_kg: 0.0,
            scales: [1.0; 4],
            size: 1.0,
            low_speed_loss: 0.0,
            choke_loss: 0.0,
            inlet_air: (100e3, 298.15),
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
        self.resize(&mut model.params);
        if self.size != 1.0 || self.low_speed_loss != 0.0 || self.choke_loss != 0.0 {
            let wheel_diameter_m = model.params.compressor.wheel_diameter_m;
            model.map = Arc::new(Lossy { map: ClosedFormMap { wheel_diameter_m }, machine: *self });
        }
        model
    }

    fn resize(&self, params: &mut Params) {
        let (compressor, turbine) = (&mut params.compressor, &mut params.turbine);
        for length_m in [
            &mut compressor.wheel_diameter_m,
            &mut compressor.outlet_diameter_m,
            &mut compressor.inlet_diameter_m,
            &mut turbine.inlet_diameter_m,
            &mut turbine.wheel_radius_m,
        ] {
            *length_m *= self.size;
        }
        for area in [
            &mut compressor.internal_area_m2,
            &mut compressor.external_area_m2,
            &mut turbine.internal_area_m2,
            &mut turbine.external_area_m2,
            &mut turbine.choked_flow_kg_s,
            &mut params.outlet.valve_area_m2,
        ] {
            *area *= self.size.powi(2);
        }
        for mass in
            [&mut compressor.housing_mass_kg, &mut turbine.housing_mass_kg, &mut params.outlet.volume_m3]
        {
            *mass *= self.size.powi(3);
        }
        params.shaft_inertia_kgm2 *= self.size.powi(5);
    }
}

/// Visits the points in the given order, `dwell_s` each, from the settled first one; 10 Hz, no noise. The turbine inlet pressure is the one
/// that holds the speed on the nominal machine.
pub fn campaign(points: &[(f64, f64)], dwell_s: f64, machine: Machine) -> Campaign {
    let (size, inlet_air) = (machine.size, machine.inlet_air);
    let (model, nominal) = (machine.model(), Machine { size, inlet_air, ..Machine::default() }.model());
    let at = |valve: f64| BoundaryConditions {
        valve_opening_ratio: valve,
        p1_pa: inlet_air.0,
        t1_k: inlet_air.1,
        ..BoundaryConditions::default()
    };
    let held =
        |(valve, speed): (f64, f64)| steady::hold_speed(&nominal, speed / size, &at(valve)).unwrap().boundary;
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
                    let t2_k = if machine.heating_cooling_ratio == 1.0 {
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
        let op = |(valve, speed): (f64, f64)| OperatingPoint {
            speed_rpm: speed / size,
            valve_opening_ratio: valve,
        };
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
    let factor = |hotter: bool| if hotter { machine.heating_cooling_ratio } else { 1.0 };
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
