//! Readings of the lab's sensors: the model's values through taps, lags and errors, collected into a batch.
//! True values are known only to the simulator, sample by sample: they are recorded under /truth and read by scoring alone.

use crate::virtual_lab::rig::drift;
use crate::virtual_lab::rig::running::{P2_SHARE, Resonator, Swing};
use crate::virtual_lab::sensors::{ElementBank, SecondOrderFollower, Sensor, SensorErrors};
use crate::virtual_lab::settings_file::LabSettings;
use mapper_core::{
    CHANNELS, Channel, ChannelColumn, ElementColumn, Event, FastSamples, MODELLED_CHANNELS, SampleBatch,
    Setpoints, TruthColumn,
};
use mapper_physics::gas::mixture::Gas;
use mapper_physics::gas::pressure_tap;
use mapper_physics::laws::turbine::isentropic_drop_j_kg;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::instruments::{ChannelFollower, Instruments};
use mapper_physics::simulation::model::{Outputs, PreparedModel, State};

/// Frequency of the surge cycle, Hz: the order of magnitude of a small compressor with a short outlet duct.
const SURGE_FREQUENCY_HZ: f64 = 7.3;

/// True values at the sensors at one instant.
pub(crate) struct Instant<'a> {
    pub(crate) boundary: BoundaryConditions,
    pub(crate) speed_rpm: f64,
    pub(crate) tc_k: f64,
    pub(crate) tt_k: f64,
    /// `None` at standstill.
    pub(crate) running: Option<(&'a State, &'a Outputs)>,
}

impl Instant<'_> {
    fn outputs(&self) -> Option<&Outputs> {
        self.running.map(|(_, outputs)| outputs)
    }

    /// Power of the turbine less what bearings and hooks take over the isentropic power from the gas behind the housing; NaN at standstill.
    fn turbine_efficiency(&self, gas: Gas) -> f64 {
        let Some(outputs) = self.outputs() else { return f64::NAN };
        let expansion_ratio = self.boundary.p3_pa / self.boundary.p4_pa;
        let drop_j_kg = isentropic_drop_j_kg(gas, outputs.turbine.t3_prime_k, expansion_ratio);
        let power_w = outputs.turbine.power_w - outputs.friction_power_w + outputs.added.shaft_power_w;
        power_w / (outputs.turbine_flow_kg_s * drop_j_kg)
    }

    /// Flow at which the current machine would surge at this speed, kg/s; NaN at standstill.
    fn surge_flow_kg_s(&self, settings: &LabSettings) -> f64 {
        let Some(outputs) = self.outputs() else { return f64::NAN };
        let map = &settings.model.map;
        let corrected_rpm = map.reference().corrected_speed_rpm(self.speed_rpm, self.boundary.t1_k);
        // In proportion to the current flow, which the model converted from corrected to physical.
        let scale_ratio = settings.model.params.compressor.flow_scale_ratio;
        let surge_ratio = scale_ratio * map.surge_point(corrected_rpm).0 / outputs.flow_corrected_kg_s;
        surge_ratio * outputs.flow_kg_s
    }
}

#[derive(Debug)]
pub(crate) struct SensorBank {
    pub(crate) sensors: Vec<(Channel, Sensor)>,
    pub(crate) followers: Vec<ChannelFollower>,
    /// Second-order sensors, by channel.
    pub(crate) second_order: Vec<Option<SecondOrderFollower>>,
    /// Channels with redundant sensors.
    pub(crate) redundant: Vec<ElementBank>,
    /// Fluctuations of flow and pressures before surge.
    pub(crate) resonator: Resonator,
    /// Fast sensors of P1 and P2; empty without a fast rate.
    pub(crate) fast: Vec<(Channel, Sensor)>,
}

/// Offset of the random streams of fast sensors, above those of redundant ones.
const STREAMS_OF_SENSORS: u64 = 1_000_000;

/// The fast sensors of P1 and P2: white noise of the declared size, no fixed error.
pub(crate) fn fast_sensors(settings: &LabSettings) -> Vec<(Channel, Sensor)> {
    let Some(rate_hz) = settings.fast_rate_hz else { return Vec::new() };
    let sensor = |channel: Channel| {
        let errors = settings.sensors.get(&channel).copied().unwrap_or_default();
        let white_sigma = errors.white_sigma.hypot(errors.coloured_sigma);
        let errors = SensorErrors { white_sigma, ..SensorErrors::default() };
        Sensor::new(errors, 1.0 / rate_hz, settings.seed, STREAMS_OF_SENSORS + channel as u64)
    };
    [Channel::P1, Channel::P2].map(|channel| (channel, sensor(channel))).into()
}

pub(crate) struct SampleCollector {
    first_sequence: u64,
    fast: Vec<FastSamples>,
    t_s: Vec<f64>,
    columns: Vec<Vec<f64>>,
    elements: Vec<ElementColumn>,
    truth: TruthRecorder,
}

impl SampleCollector {
    pub(crate) fn new(first_sequence: u64, sensor_bank: &SensorBank) -> Self {
        SampleCollector {
            first_sequence,
            fast: Vec::new(),
            t_s: Vec::new(),
            columns: vec![Vec::new(); MODELLED_CHANNELS],
            elements: sensor_bank.redundant.iter().flat_map(ElementBank::columns).collect(),
            truth: TruthRecorder::default(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Reads every sensor at one instant.
    pub(crate) fn push(
        &mut self,
        t_s: f64,
        instant: &Instant<'_>,
        commands: Option<&Setpoints>,
        sensor_bank: &mut SensorBank,
        settings: &LabSettings,
    ) {
        self.t_s.push(t_s);
        let surge_flow_kg_s = instant.surge_flow_kg_s(settings);
        let prepared = instant.running.map(|_| settings.model.prepare(&instant.boundary));
        let swing = self.push_fast(t_s, instant, surge_flow_kg_s, (sensor_bank, prepared.as_ref()), settings);
        let SensorBank { sensors, followers, second_order, redundant, .. } = sensor_bank;
        let mut elements = self.elements.iter_mut();
        let follow = followers.iter_mut().zip(second_order);
        for ((row, column), (follower, second)) in CHANNELS.iter().zip(&mut self.columns).zip(follow) {
            let total =
                true_value(row.channel, instant, prepared.as_ref(), commands, swing, &settings.instruments);
            let truth = match settings.static_tap_pipe_diameters_m.get(&row.channel) {
                Some(pipe_diameter_m) => wall_pressure_pa(row.channel, total, *pipe_diameter_m, instant),
                None => total,
            };
            let nonuniformity =
                settings.uneven_at_rest.get(&row.channel).filter(|_| instant.running.is_none());
            let truth = second.as_mut().map_or(truth, |second| second.read(t_s, truth));
            let truth = follower.read(t_s, truth) + nonuniformity.copied().unwrap_or(0.0);
            let drifted = |reading| drift::drifted_reading(&settings.drifts, row.channel, t_s, reading);
            if let Some(bank) = redundant.iter_mut().find(|bank| bank.channel == row.channel) {
                let pipe_diameter_m = settings.model.params.compressor.outlet_diameter_m;
                let (readings, combined) = bank.read(t_s, truth, instant.outputs(), pipe_diameter_m, drifted);
                readings.iter().zip(&mut elements).for_each(|(reading, column)| column.values.push(*reading));
                column.push(combined);
                continue;
            }
            let sensor = sensors.iter_mut().find(|(channel, _)| *channel == row.channel);
            column.push(drifted(sensor.map_or(truth, |(_, sensor)| sensor.read(truth))));
        }
        let states = [instant.speed_rpm, instant.tc_k, instant.tt_k, surge_flow_kg_s];
        let turbine_efficiency = instant.turbine_efficiency(settings.model.params.turbine.gas);
        self.truth.push(states, turbine_efficiency, instant.outputs());
    }

    /// The swing at `t_s`, and the fast samples since the last sample if the lab has them.
    fn push_fast(
        &mut self,
        t_s: f64,
        instant: &Instant<'_>,
        surge_flow_kg_s: f64,
        (bank, prepared): (&mut SensorBank, Option<&PreparedModel<'_>>),
        settings: &LabSettings,
    ) -> Swing {
        let interval_s = 1.0 / settings.sample_rate_hz;
        let Some(rate_hz) = settings.fast_rate_hz else {
            return compute_swing((t_s, interval_s), instant, surge_flow_kg_s, &mut bank.resonator, settings);
        };
        let count = (rate_hz * interval_s).round().max(1.0);
        let fast_s = interval_s / count;
        let mut swing = Swing::default();
        let begin_s = t_s - interval_s + fast_s;
        let still =
            |channel| true_value(channel, instant, prepared, None, Swing::default(), &settings.instruments);
        let still = bank.fast.iter().map(|(channel, _)| still(*channel)).collect::<Vec<f64>>();
        let mut values = vec![Vec::with_capacity(count as usize); still.len()];
        for index in 0..count as usize {
            let now_s = begin_s + index as f64 * fast_s;
            swing = compute_swing((now_s, fast_s), instant, surge_flow_kg_s, &mut bank.resonator, settings);
            for (((channel, sensor), still), values) in bank.fast.iter_mut().zip(&still).zip(&mut values) {
                let ratio = if *channel == Channel::P1 { swing.p1_ratio } else { swing.p2_ratio };
                values.push(sensor.read(still * (1.0 + ratio)));
            }
        }
        let channels = bank.fast.iter().map(|(channel, _)| *channel);
        self.fast.extend(channels.zip(values).map(|(channel, values)| FastSamples {
            channel,
            first_s: begin_s,
            interval_s: fast_s,
            values,
        }));
        swing
    }

    pub(crate) fn finish(self, events: Vec<Event>) -> SampleBatch {
        let columns = CHANNELS.iter().zip(self.columns);
        SampleBatch {
            first_sequence: self.first_sequence,
            columns: columns.map(|(row, values)| ChannelColumn { channel: row.channel, values }).collect(),
            elements: self.elements,
            provenance: Vec::new(),
            truth: self.truth.finish(),
            t_s: self.t_s,
            events,
            fast: self.fast,
        }
    }
}

/// Fluctuations of flow and pressures `since_s` after the last ones: the surge cycle in surge, the precursor before it.
fn compute_swing(
    (t_s, since_s): (f64, f64),
    instant: &Instant<'_>,
    surge_flow_kg_s: f64,
    resonator: &mut Resonator,
    settings: &LabSettings,
) -> Swing {
    let Some(outputs) = instant.outputs() else { return Swing::default() };
    if outputs.surge_position_ratio >= 1.0 {
        let flow_ratio =
            settings.surge_swing_ratio * (2.0 * std::f64::consts::PI * SURGE_FREQUENCY_HZ * t_s).sin();
        return Swing { flow_ratio, p2_ratio: P2_SHARE * flow_ratio, p1_ratio: 0.0 };
    }
    let margin_ratio = outputs.flow_kg_s / surge_flow_kg_s - 1.0;
    // Half of the fluctuation in surge, at which the surge cycle takes over.
    let max_rms_ratio = 0.5 * settings.surge_swing_ratio;
    let params = &settings.model.params;
    resonator.next(margin_ratio, since_s, params, outputs.t2_k, max_rms_ratio)
}

/// Static pressure at the pipe wall of one of the four stations; the total pressure if the pipe would choke.
fn wall_pressure_pa(channel: Channel, total_pa: f64, pipe_diameter_m: f64, instant: &Instant<'_>) -> f64 {
    let Some(outputs) = instant.outputs() else { return total_pa };
    let (flow_kg_s, temperature_k) = match channel {
        Channel::P1 => (outputs.flow_kg_s, instant.boundary.t1_k),
        Channel::P2 => (outputs.flow_kg_s, outputs.t2_k),
        Channel::P3 => (outputs.turbine_flow_kg_s, instant.boundary.t3_k),
        Channel::P4 => (outputs.turbine_flow_kg_s, outputs.turbine.t4_k),
        _ => return total_pa,
    };
    pressure_tap::total_to_static_pa(total_pa, flow_kg_s, temperature_k, pipe_diameter_m).unwrap_or(total_pa)
}

fn true_value(
    channel: Channel,
    instant: &Instant<'_>,
    prepared: Option<&PreparedModel<'_>>,
    commands: Option<&Setpoints>,
    swing: Swing,
    instruments: &Instruments,
) -> f64 {
    let boundary = &instant.boundary;
    let command = |value: fn(&Setpoints) -> f64| commands.map_or(f64::NAN, value);
    match channel {
        Channel::P3Command => return command(|setpoints| setpoints.p3_pa),
        Channel::T3Command => return command(|setpoints| setpoints.t3_k),
        Channel::ValveCommand => return command(|setpoints| setpoints.valve_opening_ratio),
        Channel::TOilCommand => return command(|setpoints| setpoints.oil_temperature_k),
        _ => {}
    }
    if let (Some((state, outputs)), Some(prepared)) = (instant.running, prepared) {
        let value = instruments.at_sensor(channel, prepared, state, outputs).unwrap_or(f64::NAN);
        return match channel {
            Channel::CompressorFlow => value * (1.0 + swing.flow_ratio),
            Channel::P2 => value * (1.0 + swing.p2_ratio),
            Channel::P1 => value * (1.0 + swing.p1_ratio),
            _ => value,
        };
    }
    // At rest every gas probe except T1's reads the cell temperature.
    match channel {
        Channel::ShaftSpeed | Channel::CompressorFlow | Channel::TurbineFlow => 0.0,
        Channel::P1 | Channel::P2 => boundary.p1_pa,
        Channel::T1 => boundary.t1_k,
        Channel::Tc => instant.tc_k,
        Channel::Tt => instant.tt_k,
        Channel::P3 => boundary.p3_pa,
        Channel::P4 => boundary.p4_pa,
        Channel::TOil => boundary.oil_temperature_k,
        _ => boundary.ambient_temperature_k,
    }
}

type Reader = fn(&Outputs) -> f64;

/// Columns from the model's outputs: name, unit, value. Undefined (NaN) at standstill.
const FROM_OUTPUTS: [(&str, &str, Reader); 11] = [
    ("eta", "1", |outputs| outputs.efficiency),
    ("h_w_m2k", "W/(m2 K)", |outputs| outputs.h_w_m2k),
    ("flow_kg_s", "kg/s", |outputs| outputs.flow_kg_s),
    ("pressure_ratio", "1", |outputs| outputs.pressure_ratio),
    ("surge_position_ratio", "1", |outputs| outputs.surge_position_ratio),
    ("t1_prime_k", "K", |outputs| outputs.t1_prime_k),
    ("t2_prime_k", "K", |outputs| outputs.t2_prime_k),
    ("t2_gas_k", "K", |outputs| outputs.t2_k),
    ("compressor_power_w", "W", |outputs| outputs.compressor_power_w),
    ("t3_prime_k", "K", |outputs| outputs.turbine.t3_prime_k),
    ("turbine_heat_w", "W", |outputs| outputs.turbine.heat_w),
];

#[derive(Debug, Default)]
pub struct TruthRecorder {
    from_outputs: [Vec<f64>; FROM_OUTPUTS.len()],
    speed_rpm: Vec<f64>,
    tc_k: Vec<f64>,
    tt_k: Vec<f64>,
    surge_flow_kg_s: Vec<f64>,
    turbine_efficiency: Vec<f64>,
}

impl TruthRecorder {
    /// Adds one sample: shaft speed, temperatures of both housings, surge flow at this speed; efficiency of turbine and bearings; `outputs` is
    /// `None` at standstill.
    pub fn push(
        &mut self,
        [speed_rpm, tc_k, tt_k, surge_flow_kg_s]: [f64; 4],
        turbine_efficiency: f64,
        outputs: Option<&Outputs>,
    ) {
        for (column, (_, _, read)) in self.from_outputs.iter_mut().zip(FROM_OUTPUTS) {
            column.push(outputs.map_or(f64::NAN, read));
        }
        self.speed_rpm.push(speed_rpm);
        self.tc_k.push(tc_k);
        self.tt_k.push(tt_k);
        self.surge_flow_kg_s.push(surge_flow_kg_s);
        self.turbine_efficiency.push(turbine_efficiency);
    }

    pub fn finish(self) -> Vec<TruthColumn> {
        let column = |name: &str, unit: &str, values| TruthColumn {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
        };
        let mut columns: Vec<TruthColumn> = FROM_OUTPUTS
            .iter()
            .zip(self.from_outputs)
            .map(|((name, unit, _), values)| column(name, unit, values))
            .collect();
        columns.push(column("speed_rpm", "rpm", self.speed_rpm));
        columns.push(column("tc_k", "K", self.tc_k));
        columns.push(column("tt_k", "K", self.tt_k));
        columns.push(column("surge_flow_kg_s", "kg/s", self.surge_flow_kg_s));
        columns.push(column("turbine_efficiency", "1", self.turbine_efficiency));
        columns
    }
}
