//! The virtual gas stand: the lumped model behind actuators and sensors, in simulated time.

use super::samples::{Instant, SampleCollector, SensorBank, fast_sensors};
use crate::ACCEPTED_SETPOINTS;
use crate::virtual_lab::rig::actuator::Actuator;
use crate::virtual_lab::rig::drift;
use crate::virtual_lab::rig::drift::LabDrift;
use crate::virtual_lab::rig::running::{LabInputs, MIN_EXPANSION_RATIO, Resonator, RunningMachine};
use crate::virtual_lab::sensors::{ElementBank, SecondOrderFollower, Sensor};
use crate::virtual_lab::settings_file::{LabSettings, Start};
use mapper_core::{
    Backend, BackendError, CHANNELS, Channel, Event, EventKind, GuardName, MODELLED_CHANNELS, RigDescription,
    RigMode, SafeTrajectory, SampleBatch, Setpoints,
};
use mapper_physics::laws::housing;
use mapper_physics::laws::housing::StandstillState;
use mapper_physics::rig::instruments::ChannelFollower;
use mapper_physics::simulation::model::{State, rad_s_of_rpm};
use mapper_physics::simulation::simulate::{Crossing, ModelEvent, SimulationError, Watch};
use mapper_physics::simulation::steady::Inputs;

/// Shaft speed at which the running model takes over during a start, and ends during a stop, rpm.
const CRANKING_SPEED_RPM: f64 = 5_000.0;

/// Minimum pressure ratio for surge events: during start-up the machine crosses the
/// extrapolated surge line with too little pressure to reverse the flow.
const MIN_SURGE_RATIO: f64 = 1.01;

#[derive(Debug)]
enum Machine {
    /// Gas flows.
    Running(Box<dyn RunningMachine>),
    /// The shaft is at rest.
    Standstill {
        /// Housing temperatures.
        state: StandstillState,
        t_s: f64,
    },
}

/// A simulation that stopped because a hook of an effect returned NaN.
#[derive(Debug, thiserror::Error)]
#[error("{source}: {fault}")]
struct EffectFault {
    source: SimulationError,
    fault: String,
}

#[derive(Debug)]
struct ArmedLab {
    inputs: LabInputs,
    /// `None` until the first setpoints, at which the lab starts settled.
    machine: Option<Machine>,
    requested_mode: RigMode,
    tripped: bool,
    sensor_bank: SensorBank,
    commands: Option<Setpoints>,
    now_s: f64,
    next_sequence: u64,
    pending_events: Vec<Event>,
}

/// A simulated gas stand. The same settings and calls give the same samples, to the bit.
#[derive(Debug)]
pub struct VirtualLab {
    settings: LabSettings,
    armed: Option<ArmedLab>,
}

/// Channels of the lab: all modelled ones.
fn channels() -> Vec<Channel> {
    CHANNELS[..MODELLED_CHANNELS].iter().map(|row| row.channel).collect()
}

impl VirtualLab {
    /// A lab that is not armed yet.
    pub fn new(settings: LabSettings) -> Self {
        VirtualLab { settings, armed: None }
    }

    fn armed(&mut self, call: &'static str) -> Result<(&LabSettings, &mut ArmedLab), BackendError> {
        match self.armed.as_mut() {
            Some(armed) => Ok((&self.settings, armed)),
            None => Err(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" }),
        }
    }
}

impl Backend for VirtualLab {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: self.settings.structure.name().to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            channels: channels(),
            sample_rate_hz: self.settings.sample_rate_hz,
            simulated_time: true,
            controls: true,
            exclusive: self.settings.rig.clone(),
            reached_at: None,
            needs_guarded: vec![GuardName::Overspeed, GuardName::TurbineInletPressure],
            accepts: Some(ACCEPTED_SETPOINTS),
            // Closing rate of a usual air supply.
            safe: SafeTrajectory { p3_slew_pa_s: Some(100e3), valve_opening_ratio: 1.0, within_s: 20.0 },
        }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed.is_some() {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        let settings = &self.settings;
        let cell = settings.cell;
        let sample_s = 1.0 / settings.sample_rate_hz;
        let sensors = channels()
            .into_iter()
            .filter_map(|channel| {
                let errors = settings.sensors.get(&channel)?;
                Some((channel, Sensor::new(*errors, sample_s, settings.seed, channel as u64)))
            })
            .collect();
        let at_rest = StandstillState { tc_k: cell.ambient_temperature_k, tt_k: cell.ambient_temperature_k };
        self.armed = Some(ArmedLab {
            inputs: LabInputs {
                cell,
                weather: settings.weather.clone(),
                p3: Actuator::at_rest(settings.p3_actuator, cell.p4_pa * MIN_EXPANSION_RATIO),
                t3: Actuator::at_rest(settings.t3_actuator, cell.t3_k),
                valve: Actuator::at_rest(settings.valve_actuator, cell.valve_opening_ratio),
                oil: Actuator::at_rest(settings.oil_actuator, cell.oil_temperature_k),
                sag: settings.sag_at_rest(cell.p4_pa * MIN_EXPANSION_RATIO),
            },
            machine: match settings.start {
                Start::Standstill => Some(Machine::Standstill { state: at_rest, t_s: 0.0 }),
                Start::Settled => None,
            },
            requested_mode: RigMode::Standstill,
            tripped: false,
            sensor_bank: SensorBank {
                sensors,
                followers: CHANNELS
                    .iter()
                    .map(|row| ChannelFollower::new(*settings.instruments.path(row.channel)))
                    .collect(),
                redundant: settings
                    .redundant
                    .iter()
                    .map(|(channel, elements)| ElementBank::new(*channel, elements, sample_s, settings.seed))
                    .collect(),
                second_order: CHANNELS
                    .iter()
                    .map(|row| {
                        let dynamics = settings.second_order.get(&row.channel)?;
                        Some(SecondOrderFollower::new(*dynamics))
                    })
                    .collect(),
                resonator: Resonator::new(settings.surge_precursor, settings.seed),
                fast: fast_sensors(settings),
            },
            commands: None,
            now_s: 0.0,
            next_sequence: 0,
            pending_events: Vec::new(),
        });
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        ACCEPTED_SETPOINTS.check(setpoints)?;
        let (settings, armed) = self.armed("set")?;
        armed.commands = Some(*setpoints);
        armed.requested_mode = if armed.tripped { RigMode::Standstill } else { setpoints.mode };
        let now_s = armed.now_s;
        let p3_pa = match armed.requested_mode {
            RigMode::Running => setpoints.p3_pa,
            RigMode::Standstill => armed.inputs.cell.p4_pa * MIN_EXPANSION_RATIO,
        };
        let opening_ratio = settings.instruments.valve.reached(setpoints.valve_opening_ratio);
        let is_first = armed.machine.is_none();
        armed.inputs.set_p3(now_s, p3_pa);
        for (actuator, command) in [
            (&mut armed.inputs.t3, setpoints.t3_k),
            (&mut armed.inputs.valve, opening_ratio),
            (&mut armed.inputs.oil, setpoints.oil_temperature_k),
        ] {
            actuator.set(now_s, command);
        }
        if is_first {
            // The rig starts in the steady state of its first setpoints.
            armed.inputs.p3 = Actuator::at_rest(settings.p3_actuator, p3_pa);
            armed.inputs.t3 = Actuator::at_rest(settings.t3_actuator, setpoints.t3_k);
            armed.inputs.valve = Actuator::at_rest(settings.valve_actuator, opening_ratio);
            armed.inputs.oil = Actuator::at_rest(settings.oil_actuator, setpoints.oil_temperature_k);
            armed.inputs.sag = settings.sag_at_rest(p3_pa);
            armed.machine = Some(settle(settings, armed, now_s)?);
        } else if let Some(Machine::Running(simulator)) = armed.machine.as_mut() {
            simulator.restart();
        }
        Ok(())
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let (settings, armed) = self.armed("poll")?;
        armed.advance(settings, until_s)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.armed("hold").map(drop)
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        let (settings, armed) = self.armed("make_safe")?;
        let now_s = armed.now_s;
        armed.requested_mode = RigMode::Standstill;
        armed.inputs.set_p3(now_s, armed.inputs.cell.p4_pa * MIN_EXPANSION_RATIO);
        armed.inputs.valve.set(now_s, 1.0f64.max(armed.inputs.valve.value(now_s)));
        if let Some(Machine::Running(simulator)) = armed.machine.as_mut() {
            simulator.restart();
        } else if armed.machine.is_none() {
            let ambient_k = settings.cell.ambient_temperature_k;
            let state = StandstillState { tc_k: ambient_k, tt_k: ambient_k };
            armed.machine = Some(Machine::Standstill { state, t_s: now_s });
        }
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.armed("disarm")?;
        self.armed = None;
        Ok(())
    }
}

/// A machine in steady state under the current inputs.
fn settle(settings: &LabSettings, armed: &ArmedLab, now_s: f64) -> Result<Machine, BackendError> {
    match armed.requested_mode {
        RigMode::Running => {
            let boundary = armed.inputs.at(now_s);
            let machine = settings.structure.settled(&settings.model, now_s, &boundary, watch(settings));
            let machine = machine.map_err(|source| BackendError::Simulation { t_s: now_s, source })?;
            Ok(Machine::Running(machine))
        }
        RigMode::Standstill => {
            let ambient_k = settings.cell.ambient_temperature_k;
            let state = StandstillState { tc_k: ambient_k, tt_k: ambient_k };
            // After a day at rest.
            let oil_k = armed.inputs.oil.value(now_s);
            let state = housing::relax(&settings.model.params, state, oil_k, ambient_k, 86_400.0);
            Ok(Machine::Standstill { state, t_s: now_s })
        }
    }
}

fn watch(settings: &LabSettings) -> Watch {
    Watch { overspeed_rpm: settings.trip_speed_rpm }
}

impl ArmedLab {
    fn advance(&mut self, settings: &LabSettings, until_s: f64) -> Result<SampleBatch, BackendError> {
        let mut batch = SampleCollector::new(self.next_sequence, &self.sensor_bank);
        // A time before the first sample, or NaN, requests no sample.
        let needs_first_sample = self.next_sequence == 0 && until_s >= 0.0;
        while self.now_s < until_s || (self.now_s == 0.0 && needs_first_sample) {
            self.switch_machine(settings);
            self.drift(settings);
            let next_s = self.advance_machine(settings, until_s, &mut batch)?;
            self.now_s = next_s;
            if until_s <= 0.0 {
                break;
            }
        }
        self.next_sequence += batch.len() as u64;
        Ok(batch.finish(std::mem::take(&mut self.pending_events)))
    }

    /// Switches between standstill and the running model if the requested mode asks for it.
    fn switch_machine(&mut self, settings: &LabSettings) {
        let now_s = self.now_s;
        let next = match (&self.machine, self.requested_mode) {
            (Some(Machine::Standstill { state, .. }), RigMode::Running) => {
                let cell = &self.inputs.cell;
                let speed_rad_s = rad_s_of_rpm(CRANKING_SPEED_RPM);
                let start = State::new(speed_rad_s, cell.p1_pa * 1.0005, state.tc_k, state.tt_k, cell.t1_k);
                Machine::Running(settings.structure.start(&settings.model, now_s, start, watch(settings)))
            }
            (Some(Machine::Running(simulator)), RigMode::Standstill)
                if simulator.state().shaft_speed_rpm() < CRANKING_SPEED_RPM =>
            {
                let State { tc_k, tt_k, .. } = simulator.state();
                Machine::Standstill { state: StandstillState { tc_k, tt_k }, t_s: now_s }
            }
            _ => return,
        };
        self.machine = Some(next);
    }

    fn drift(&mut self, settings: &LabSettings) {
        if let Some(Machine::Running(simulator)) = self.machine.as_mut()
            && settings.drifts.iter().any(LabDrift::is_machine)
        {
            let interval_start_s =
                (self.now_s / drift::MACHINE_UPDATE_S + 1e-9).floor() * drift::MACHINE_UPDATE_S;
            let middle_s = interval_start_s + 0.5 * drift::MACHINE_UPDATE_S;
            simulator.change_params(drift::drifted_machine(
                &settings.drifts,
                settings.model.params,
                middle_s,
            ));
        }
    }

    /// Runs the machine to `until_s`, or for at most a second while it is stopping; returns the time reached.
    fn advance_machine(
        &mut self,
        settings: &LabSettings,
        until_s: f64,
        batch: &mut SampleCollector,
    ) -> Result<f64, BackendError> {
        let start_s = self.now_s;
        let coasting = self.requested_mode == RigMode::Standstill;
        let mut end_s = if coasting { until_s.min(start_s + 1.0) } else { until_s };
        if settings.drifts.iter().any(LabDrift::is_machine) {
            // A fixed grid, so that the result does not depend on the polling rate.
            end_s = end_s
                .min(((start_s / drift::MACHINE_UPDATE_S + 1e-9).floor() + 1.0) * drift::MACHINE_UPDATE_S);
        }
        let first_index = self.next_sequence + batch.len() as u64;
        let rate_hz = settings.sample_rate_hz;
        if settings.inlet_loss_pa > 0.0 {
            // P1 follows the flow from sample to sample.
            end_s = end_s.min(first_index as f64 / rate_hz);
        }
        let mut sample_times_s =
            (first_index..).map(|index| index as f64 / rate_hz).take_while(|t| *t <= end_s);
        let ArmedLab { inputs, machine, sensor_bank, commands, .. } = self;
        match machine {
            None => Err(BackendError::OutOfOrder {
                call: "poll",
                state: "armed without setpoints",
                needed: "given its first setpoints (`set`)",
            }),
            Some(Machine::Running(simulator)) => {
                let (mut crossings, mut flow_kg_s) = (Vec::new(), None);
                let result = simulator.run_to(
                    end_s,
                    inputs,
                    &mut sample_times_s,
                    &mut |t_s, state, outputs| {
                        let instant = Instant {
                            boundary: inputs.at(t_s),
                            speed_rpm: state.shaft_speed_rpm(),
                            tc_k: state.tc_k,
                            tt_k: state.tt_k,
                            running: Some((state, outputs)),
                        };
                        batch.push(t_s, &instant, commands.as_ref(), sensor_bank, settings);
                        flow_kg_s = Some(outputs.flow_kg_s);
                    },
                    &mut |event| crossings.push(event),
                );
                if let Some(flow_kg_s) = flow_kg_s.filter(|_| settings.inlet_loss_pa > 0.0) {
                    let lost = (flow_kg_s / LabSettings::LOSS_FLOW_KG_S).powi(2);
                    inputs.cell.p1_pa = settings.cell.p1_pa - settings.inlet_loss_pa * lost;
                }
                for crossing in crossings {
                    self.report(settings, crossing, end_s);
                }
                result.map_err(|error| {
                    // A failed hook returns NaN and stores the reason.
                    let source = match settings.model.hooks.fault() {
                        Some(fault) => EffectFault { source: error, fault }.into(),
                        None => error.into(),
                    };
                    BackendError::Simulation { t_s: start_s, source }
                })?;
                Ok(end_s)
            }
            Some(Machine::Standstill { state, t_s: state_s }) => {
                let params = &settings.model.params;
                inputs.cell.p1_pa = settings.cell.p1_pa;
                let ambient_k = inputs.cell.ambient_temperature_k;
                let mut relax_to = |t_s: f64| {
                    let oil_k = inputs.oil.value(t_s);
                    if t_s > *state_s {
                        *state = housing::relax(params, *state, oil_k, ambient_k, t_s - *state_s);
                        *state_s = t_s;
                    }
                    *state
                };
                for t_s in sample_times_s {
                    let StandstillState { tc_k, tt_k } = relax_to(t_s);
                    let boundary = inputs.at(t_s);
                    let instant = Instant { speed_rpm: 0.0, boundary, tc_k, tt_k, running: None };
                    batch.push(t_s, &instant, commands.as_ref(), sensor_bank, settings);
                }
                relax_to(end_s);
                Ok(end_s)
            }
        }
    }

    /// Reports a crossing as an event; beyond the trip speed the lab cuts its air at `now_s`.
    fn report(&mut self, settings: &LabSettings, event: ModelEvent, now_s: f64) {
        let ModelEvent { t_s, crossing, speed_rpm, pressure_ratio } = event;
        let is_surge = matches!(crossing, Crossing::SurgeEntered | Crossing::SurgeLeft);
        if is_surge && pressure_ratio < MIN_SURGE_RATIO {
            return;
        }
        let (kind, message) = match crossing {
            Crossing::SurgeEntered => (
                EventKind::SurgeEntered,
                format!("surge: at {speed_rpm:.0} rpm the pressure ratio reached {pressure_ratio:.4}"),
            ),
            Crossing::SurgeLeft => (
                EventKind::SurgeLeft,
                format!("surge has ended at {speed_rpm:.0} rpm, pressure ratio {pressure_ratio:.4}"),
            ),
            Crossing::OverspeedEntered => (
                EventKind::OverspeedEntered,
                format!(
                    "overspeed: the shaft passed {:.0} rpm, the rig has cut its air",
                    settings.trip_speed_rpm
                ),
            ),
            Crossing::OverspeedLeft => (
                EventKind::OverspeedLeft,
                format!("the shaft is below {:.0} rpm again", settings.trip_speed_rpm),
            ),
        };
        if crossing == Crossing::OverspeedEntered {
            self.tripped = true;
            self.requested_mode = RigMode::Standstill;
            self.inputs.set_p3(now_s, self.inputs.cell.p4_pa * MIN_EXPANSION_RATIO);
        }
        self.pending_events.push(Event { t_s, kind, message });
        if crossing == Crossing::OverspeedEntered {
            let message = "the rig has tripped by itself: overspeed".to_owned();
            self.pending_events.push(Event { t_s, kind: EventKind::RigTripped, message });
        }
    }
}
